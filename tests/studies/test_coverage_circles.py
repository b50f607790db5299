"""The study of figures of circles, small; its whole size is a command whose last figures stand in docs/circles.md."""

from __future__ import annotations

import pytest
from scipy.stats import binom

from studies.coverage_circles import CELLS, KINDS, coverage_of_circles, pooled

CHANCE = 1e-4
"""Of a row whose true coverage is 93 % to fail by chance."""

ROWS = {
    "G", "G(LS)", "Fmax", "Fmin", "radius", "mean radial error", "centre", "centre deviation", "G, Gaussian filters",
    "G, 30 UPR", "G(LS), 30 UPR", "G(b)", "G(b)(LS)", "D", "H", "squareness", "scale mismatch", "servo mismatch",
    "backlash step", "reversal spike",
}  # fmt: skip
"""Every figure of circles that is printed with U."""


@pytest.mark.slow
def test_intervals_of_circles_hold_the_truth():
    """White and correlated noise of 0.3 µm: no row is below 93 % by more than chance, by all kinds of circles or by one."""
    told = []
    found = coverage_of_circles(15, 5000, told.append, [CELLS[1], CELLS[4]])
    assert told == list(range(1, 31))
    rows = found["rows"]
    assert set(rows) >= ROWS
    for name, row in rows.items():
        for kind in ("", *KINDS):
            inside, draws = pooled(row, kind=kind)
            assert inside >= binom.ppf(CHANCE, draws, 0.93), f"{name} {kind}: {inside} of {draws}"
        if "printed without U" in name:
            inside, draws = pooled(row)
            assert inside == draws
