"""What was known of a simulation's parameters before: what refitting them may take up, and what is said where they move far."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dbbstation.diagnosis.table.mismatch import find_mismatch, refitted
from dbbstation.errors import ArgumentError, InputError
from dbbstation.facts.value import Value
from dbbstation.inference.levels import Verdict
from dbbstation.results.mismatch import mismatch_result
from dbbstation.tasks.tables import TableOptions, load_tables, stated_uncertainties

ROWS, NOISE_MM, LINE_MM, STIFFNESS_OFF = 300, 0.01, 0.06, 0.02


@pytest.fixture
def path(tmp_path: Path, rng: np.random.Generator) -> Path:
    """Rows whose stiffness is off by 0.02, and a straight line over the load that the derivative by the stiffness nearly is."""
    load = 100.0 * np.sin(np.linspace(0.0, 17.0, ROWS))
    place = 50.0 * np.cos(np.linspace(0.0, 31.0, ROWS))
    derivative = 1e-3 * load + 5e-4 * place
    measured = place + 0.5 + STIFFNESS_OFF * derivative + LINE_MM * load / 100.0 + NOISE_MM * rng.standard_normal(ROWS)
    lines = ["t_s,measured_mm,simulated_mm,load_n,place_mm,d_stiffness"]
    columns = (np.arange(ROWS) * 0.1, measured, place, load, place, derivative)
    lines += [",".join(f"{value:.6f}" for value in row) for row in zip(*columns, strict=True)]
    target = tmp_path / "bent.csv"
    target.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return target


def told(path: Path, **asked):
    question = TableOptions("measured_mm", "simulated_mm", {"load_n": None, "t_s": None}, **asked)
    return find_mismatch(load_tables([path], question).table, hold_out=False)


def test_what_was_known_keeps_a_parameter_from_taking_up_an_effect(path):
    surely = told(path, known={"stiffness": 0.02})
    linear = next(one for one in surely.findings if one.name == "linear in load_n")
    assert linear.verdict is Verdict.IDENTIFIED
    (stiffness,) = surely.parameters
    assert stiffness.stated
    assert stiffness.known == 0.02
    assert abs(stiffness.after.value - STIFFNESS_OFF) < 3.0 * stiffness.after.uncertainty
    freely = told(path, free=("stiffness",))
    (alone,) = freely.parameters
    assert alone.known is None
    assert not alone.far
    # 0.06 mm at 100 N are 0.6 of a derivative of 1e-3 mm/N.
    assert alone.after.value == pytest.approx(0.62, abs=0.05)
    assert next(one for one in freely.findings if one.name == "linear in load_n").verdict is not Verdict.IDENTIFIED


@pytest.mark.parametrize(
    ("value", "known", "stated", "far"),
    [
        (0.29, 0.1, True, False),
        (-0.31, 0.1, True, True),
        (0.09, 0.1, False, False),
        (0.11, 0.1, False, True),
        (9.0, None, False, False),
    ],
)
def test_what_moves_far_is_said_to(value, known, stated, far):
    none = Value(0.0, 1.0, "")
    assert refitted("mass", none, Value(value, 0.01, ""), 0.0, known, stated=stated).far == far


def test_by_default_refitting_moves_the_simulation_by_about_what_it_was_off(path):
    table = load_tables([path], TableOptions("measured_mm", "simulated_mm")).table
    moves = table.spread_of("stiffness") * np.sqrt(np.mean(np.square(table.derivatives["stiffness"])))
    assert moves == pytest.approx(2.0 * np.std(table.measured - table.simulated))


def test_the_constant_may_be_left_out(path):
    without = told(path, has_offset=False)
    result = mismatch_result(without)
    assert result.offset is None
    assert [one.name for one in result.parameters] == ["stiffness"]
    # Half a millimetre that nothing may take up is a mismatch.
    assert result.mismatch
    assert mismatch_result(told(path)).offset.value == pytest.approx(0.5, abs=0.01)


def test_statements_that_fit_nothing_are_refused(path):
    for asked in ({"known": {"mass": 1.0}}, {"free": ("mass",)}):
        with pytest.raises(InputError, match="`mass` is no parameter of this table"):
            load_tables([path], TableOptions("measured_mm", "simulated_mm", **asked))
    with pytest.raises(InputError, match="is also stated with --known"):
        load_tables([path], TableOptions("measured_mm", "simulated_mm", known={"stiffness": 1.0}, free=("stiffness",)))


@pytest.mark.parametrize("text", ["stiffness", "stiffness=0", "stiffness=-1", "stiffness=inf", "=1", "stiffness=a"])
def test_uncertainties_that_are_none_are_refused(text):
    with pytest.raises(ArgumentError, match="is not understood"):
        stated_uncertainties(text)


def test_several_uncertainties():
    assert stated_uncertainties("mass=0.2, stiffness=3e2") == {"mass": 0.2, "stiffness": 300.0}
