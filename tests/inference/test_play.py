"""Play against a thing in a gap that is pushed row by row."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.laws.play import within

if TYPE_CHECKING:
    from numpy.typing import NDArray


def pushed(values: NDArray[np.float64], width: float) -> NDArray[np.float64]:
    """Place within a gap of a width, from -1 to 1: what lies in it moves only where a side of the gap takes it along."""
    found, lies = np.empty(len(values)), values[0]
    for k, value in enumerate(values):
        lies = min(max(lies, value - 0.5 * width), value + 0.5 * width)
        found[k] = 2.0 * (value - lies) / width
    return found


@pytest.mark.parametrize("width", [0.3, 2.0, 9.0])
def test_play_is_that_of_a_thing_in_a_gap(rng, width):
    values = np.cumsum(rng.standard_normal(300))
    values[100:110] = values[100]
    assert within(values, (slice(0, 300),), width) == pytest.approx(pushed(values, width), abs=1e-12)
