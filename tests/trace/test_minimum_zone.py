"""The minimum zone against brute force and closed forms."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import linprog, minimize

from dbbstation.errors import TraceError
from dbbstation.trace.minimum_zone import minimum_zone

TURN = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)


def path(radius, angle=TURN, centre=(0.0, 0.0)):
    return np.column_stack([centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)])


def polygon(rng):
    """Corners in any directions round a point; some nearly round, some not at all."""
    count = int(rng.integers(5, 13))
    angle = 2.0 * np.pi * (np.arange(count) + rng.uniform(-0.3, 0.3, count)) / count
    rough = 10.0 ** rng.uniform(-4.0, -0.7)
    return path(150.0 * (1.0 + rough * rng.uniform(-1.0, 1.0, count)), angle, rng.normal(0.0, 5.0, 2))


def crossings(a, b, c, d):
    """Where the bisector of a and b crosses that of c and d, for many four points (m, 2); those that are parallel are left out."""
    matrices = 2.0 * np.stack([b - a, d - c], axis=1)
    rights = np.stack([(b * b - a * a).sum(axis=1), (d * d - c * c).sum(axis=1)], axis=1)
    cross = np.abs(np.linalg.det(matrices)) >= 1e-9
    return np.linalg.solve(matrices[cross], rights[cross, :, None])[:, :, 0]


def width(points, centre):
    return np.ptp(np.hypot(*(points - centre).T))


def brute_force(points):
    """Least width about every centre that three points or two pairs determine; of three points, two pairs share one."""
    pairs = list(combinations(range(len(points)), 2))
    (a, b), (c, d) = np.array(list(combinations(pairs, 2))).transpose(1, 2, 0)
    centres = crossings(points[a], points[b], points[c], points[d])
    distances = np.hypot(*(points[None] - centres[:, None]).transpose(2, 0, 1))
    return np.ptp(distances, axis=1).min()


def test_a_thousand_polygons_against_brute_force():
    rng = np.random.default_rng(19)
    for _ in range(1000):
        points = polygon(rng)
        assert minimum_zone(points).width_mm == pytest.approx(brute_force(points), abs=1e-9)


def test_no_search_that_knows_nothing_of_bisectors_finds_less():
    rng = np.random.default_rng(20)
    for _ in range(30):
        points = polygon(rng)
        found = minimum_zone(points)
        starts = points.mean(axis=0) + rng.normal(0.0, 10.0, (8, 2))
        options = {"xatol": 1e-10, "fatol": 1e-12, "maxiter": 4000}
        least = min(
            minimize(lambda c, p=points: width(p, c), s, method="Nelder-Mead", options=options).fun for s in starts
        )
        assert found.width_mm <= least + 1e-9
        assert found.width_mm == pytest.approx(width(points, found.centre_mm), abs=1e-12)


def test_long_noisy_traces_against_a_linear_programme():
    rng = np.random.default_rng(21)
    for _ in range(5):
        radius = 150.0 + 0.02 * np.cos(2 * TURN) + 0.005 * np.sin(7 * TURN) + rng.normal(0.0, 5e-4, len(TURN))
        points = path(radius, TURN, (0.1, -0.2))
        found = minimum_zone(points)
        off = points - found.centre_mm
        distance = np.hypot(*off.T)
        unit, one = off / distance[:, None], np.ones((len(off), 1))
        rows = np.vstack([np.hstack([-unit, -one, -one]), np.hstack([unit, one, -one])])
        best = linprog(
            [0, 0, 0, 1], rows, np.concatenate([-distance, distance]), bounds=[(None, None)] * 3 + [(0, None)]
        )
        assert found.width_mm == pytest.approx(2.0 * best.fun, abs=1e-8)


def test_a_shifted_circle_has_no_width():
    found = minimum_zone(path(150.0, TURN, (0.3, -0.4)))
    assert found.width_mm == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize(("lobes", "share"), [(2, 2.0), (3, 2.0), (5, 2.0)])
def test_even_lobes_have_twice_their_amplitude(lobes, share):
    found = minimum_zone(path(150.0 + 0.01 * np.cos(lobes * TURN)))
    assert found.width_mm == pytest.approx(share * 0.01, rel=1e-4)
    assert found.centre_mm == pytest.approx((0.0, 0.0), abs=1e-4)


def test_one_bump_is_not_all_seen():
    radius = np.full(len(TURN), 150.0)
    radius[0] += 0.01
    found = minimum_zone(path(radius))
    assert 0.004 < found.width_mm < 0.0101


def test_three_points_have_no_zone():
    with pytest.raises(TraceError, match="fewer than four"):
        minimum_zone(path(150.0, np.array([0.0, 1.0, 2.0])))
