"""Coverage of calibration and prediction in little; its whole size is a command whose figures stand in docs/validation.md."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from studies.coverage_calibration import CASES, coverage_of_calibration, drawn_figures
from studies.coverage_rows import LEAST, WITHIN, row_of

DRAWS, MORE = 3, 8
"""Too few to show what the whole study does: that u lacks a part of correlated noise (docs/validation.md)."""


@pytest.fixture(scope="module", params=[DRAWS, pytest.param(MORE, marks=pytest.mark.nightly)])
def draws(request):
    return request.param


@pytest.fixture(scope="module")
def rows(draws):
    told = []
    found = coverage_of_calibration(CASES[:2], range(2000, 2000 + draws), told.append)
    assert told == list(range(1, 2 * draws + 1))
    return {(row.case, row.figure): row for row in found}


@pytest.mark.slow
def test_stated_intervals_hold_the_truth(rows, draws):
    """Values of one machine hang together: each machine counts once, at the 99.9 % limit of a binomial."""
    fewest = stats.binom.ppf(0.001, draws, LEAST) / draws
    for row in rows.values():
        assert row.inside is None or row.inside >= fewest, row
        assert not row.fault


@pytest.mark.slow
@pytest.mark.parametrize("figure", ["base joints Z", "predicted Z"])
def test_what_level_bars_do_not_see_is_stated_only_by_a_tolerance(rows, figure):
    unknown, known = (rows[case.name, figure] for case in CASES[:2])
    assert (unknown.stated, unknown.inside) == (0.0, None)
    assert known.stated == 1.0
    assert known.u == pytest.approx(50.0 / np.sqrt(6.0), rel=0.2)  # six joints of 50 µm together


@pytest.mark.slow
@pytest.mark.parametrize("figure", ["predicted X", "predicted Y", "strut lengths"])
def test_what_they_do_see_is_stated(rows, figure):
    assert all(rows[case.name, figure].stated > 0.9 for case in CASES[:2])


@pytest.mark.parametrize("seed", [30, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in (19, 48, 145))])
def test_steps_that_swing_along_what_is_hardly_seen_find_the_end(seed):
    """Full Gauss-Newton steps became 8 % shorter each, with the sign turned: 30 of them were not enough."""
    (case,) = (case for case in CASES if case.gravity)
    found = drawn_figures(case, seed)
    off, u = found["compliance"]
    assert np.all(np.abs(off) < 4.0 * u)


def test_a_row_counts_what_is_inside_and_how_surely(rng):
    """Values of one draw that are all alike are worth one; the standard error is that of so many draws."""
    off = np.repeat(rng.standard_normal((4_000, 1)), 5, axis=1)
    row = row_of("case", "figure", off, np.ones((4_000, 5)), "µm")
    assert row.inside == pytest.approx(0.95, abs=4.0 * np.sqrt(0.95 * 0.05 / 4_000))
    assert row.error == pytest.approx(np.sqrt(0.95 * 0.05 / 4_000), rel=0.1)
    assert row.fault == ""
    assert (row.values, row.stated, row.u) == (20_000, 1.0, 1.0)


@pytest.mark.parametrize(("u", "said"), [(0.7, "only"), (2.0, "no reason beside it")])
def test_intervals_that_are_too_short_or_too_long_are_a_fault(rng, u, said):
    off = rng.standard_normal((2_000, 1))
    assert said in row_of("case", "figure", off, np.full_like(off, u), "µm").fault
    assert row_of("case", "figure", off, np.full_like(off, 2.0), "µm", "because").fault == ""


def test_values_without_an_uncertainty_are_not_counted(rng):
    off = rng.standard_normal((50, 2))
    u = np.tile([1.0, np.nan], (50, 1))
    row = row_of("case", "figure", off, u, "µm")
    assert (row.values, row.stated) == (50, 0.5)
    assert row.inside == np.mean(np.abs(off[:, 0]) < WITHIN)
