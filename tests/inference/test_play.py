"""Play against a thing in a gap that is pushed row by row, and what is said of a table that lacks a wide one."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.inference.patterns import play
from dbbstation.inference.play import WIDTHS, play_laws
from dbbstation.inference.read_off import read_off
from dbbstation.inference.settle import settle
from dbbstation.inference.variables import Kind, Variable
from dbbstation.inference.verdict import Verdict
from tests.inference.tables import table
from tests.inference.test_channel import channel

if TYPE_CHECKING:
    from numpy.typing import NDArray


def pushed(values: NDArray[np.float64], width: float, begins: float = 0.0) -> NDArray[np.float64]:
    """Place within a gap of a width, from -1 to 1: what lies in it moves only where a side of the gap takes it along."""
    found, lies = np.empty(len(values)), values[0] - 0.5 * begins * width
    for k, value in enumerate(values):
        lies = min(max(lies, value - 0.5 * width), value + 0.5 * width)
        found[k] = 2.0 * (value - lies) / width
    return found


@pytest.mark.parametrize("width", [0.3, 2.0, 9.0])
@pytest.mark.parametrize("begins", [0.0, 1.0, -0.4])
def test_play_is_that_of_a_thing_in_a_gap(rng, width, begins):
    values = np.cumsum(rng.standard_normal(300))
    values[100:110] = values[100]
    assert play(values, (slice(0, 300),), width, begins) == pytest.approx(pushed(values, width, begins), abs=1e-12)


def test_each_run_begins_by_itself_and_its_start_fades():
    values = np.tile(10.0 * np.sin(np.arange(60.0) / 5.0), 2)
    blocks = (slice(0, 60), slice(60, 120))
    (law,) = play_laws([Variable("x", "mm", Kind.LENGTH, values)], blocks, 1.0, "mm")
    (shares,) = law.grids
    assert shares == pytest.approx(np.array(WIDTHS) * np.ptp(values))
    columns = law.columns((12.0,))
    assert columns.shape == (120, 3)
    for k, rows in enumerate(blocks):
        # A thing at a side of the gap is half a width from its middle, until a side takes both along.
        sides = [pushed(values[rows], 12.0, begins) for begins in (1.0, -1.0)]
        assert columns[rows, 0] == pytest.approx(pushed(values[rows], 12.0), abs=1e-12)
        assert columns[rows, 1 + k] == pytest.approx(0.5 * (sides[0] - sides[1]), abs=1e-12)
        assert columns[rows, 2 - k] == pytest.approx(np.zeros(60), abs=0.0)
        assert columns[rows, 1 + k][-1] == pytest.approx(0.0, abs=1e-12)


def test_what_goes_one_way_only_has_no_play():
    rising = Variable("x", "mm", Kind.LENGTH, np.arange(50.0))
    clock = Variable("t_s", "s", Kind.TIME, np.sin(np.arange(50.0)))
    assert play_laws([rising, clock], (slice(0, 50),), 1.0, "mm") == []


@pytest.mark.parametrize(("seed", "share"), [(1, 0.3), (2, 0.45)])
def test_a_wide_play_is_named_with_its_width(seed, share):
    data = table(seed, lambda d: 0.15 * pushed(d.q, share * float(np.ptp(d.q))), rows=800)
    plain = channel(data)
    laws = tuple(play_laws(plain.variables, plain.blocks, float(np.std(data.residual)), "mm"))
    found = [one for one in read_off(settle(replace(plain, laws=laws))) if one.verdict is Verdict.IDENTIFIED]
    (play_of_q,) = found
    assert play_of_q.name == "play of q"
    for name, truth in (("half width", 0.15), ("way", share * float(np.ptp(data.q)))):
        value = play_of_q.values[name]
        assert abs(value.value - truth) < 4.0 * value.uncertainty
        assert value.uncertainty < 0.2 * truth
