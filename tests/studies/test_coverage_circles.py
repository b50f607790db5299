"""The study of figures of circles, small; its whole size is a command whose last figures stand in docs/validation.md."""

from __future__ import annotations

import pytest
from scipy.stats import binom

from studies.coverage_circles import CELLS, CHANCE, KINDS, SURE, coverage_of_circles, faults_of, pooled

ROWS = {
    "G", "G(LS)", "Fmax", "Fmin", "radius", "mean radial error", "centre", "centre deviation", "G, Gaussian filters",
    "G, 30 UPR", "G(LS), 30 UPR", "G(b)", "G(b)(LS)", "D", "H", "squareness", "scale mismatch", "servo mismatch",
    "backlash step", "reversal spike",
}  # fmt: skip
"""Every figure of circles that is printed with U."""


@pytest.mark.slow
@pytest.mark.parametrize("draws", [2, pytest.param(6, marks=pytest.mark.nightly)])
def test_intervals_of_circles_hold_the_truth(tmp_path, draws):
    """No row is below 93 % by more than chance, by all noises and kinds of circles, by one noise, or by one kind."""
    told = []
    found = coverage_of_circles(draws, 5000, told.append, keep=tmp_path / "draws.jsonl")
    assert told == list(range(1, draws * len(CELLS) + 1))
    rows = found["rows"]
    assert set(rows) >= ROWS
    assert found["faults"] == []
    for name, row in rows.items():
        for noise, kind in (*((cell.name, "") for cell in CELLS), *(("", kind) for kind in KINDS)):
            inside, count = pooled(row, noise, kind)
            assert inside >= binom.ppf(CHANCE, count, 0.93), f"{name} {noise} {kind}: {inside} of {count}"
    again = coverage_of_circles(draws, 5000, lambda _done: None, keep=tmp_path / "draws.jsonl")
    assert again == found


def test_rows_that_are_not_as_promised_are_named():
    def row(inside, draws):
        return {"white 0.1 µm": {"perfect": {"inside": inside, "draws": draws}}}

    rows = {
        "D": row(880, 1000),
        "X": row(935, 1000),
        "radius": row(999, 1000),
        "G": row(1000, 1000),
        f"Fmax, bar not known: {SURE}": row(999, 1000),
    }
    assert faults_of({"rows": rows}) == [
        "D: only 88.0 % inside",
        "radius: 99.9 % inside, and no reason beside it",
        f"Fmax, bar not known: {SURE}: 1 of 1000 are not",
    ]
