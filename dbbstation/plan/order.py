"""Orders of tests: with few holder changes, or with heights uncorrelated with drift."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats
    from dbbstation.plan.plan import Plan

LARGEST_LEAK = 0.05
"""Largest correlation of height and drift that an order may have: a drift of 10 µm then imitates less than 0.5 µm of
height effect, less than a holder's repeatability. On Table II, 0.05 and 0.1 give the same order with 4 changes of
holder, 0.02 takes 7, and the plan's own order has 2 and a correlation of 0.945 (tests/plan/test_order.py)."""

_STARTS = 40
"""Random starting orders of the search, beside the plan's order and the order by holder. With 40 the search finds the
optimum of all orders (tests/plan/test_order.py); each takes some milliseconds."""

_SEED = 0
"""Seed of these orders: a plan always gets the same order, so an interrupted session can continue."""

_TINY = 1e-9
"""Correlations that differ by less differ by rounding only."""


def by_holder(plan: Plan) -> tuple[str, ...]:
    """Return tests grouped by holder, then ball, in order of first mention: each is set up once."""
    balls = {test.ball.name: test.ball.holder for test in plan.tests.values()}
    holders, names = list(dict.fromkeys(balls.values())), list(balls)
    tests = sorted(plan.tests.values(), key=lambda test: (holders.index(test.ball.holder), names.index(test.ball.name)))
    return tuple(test.name for test in tests)


def against_drift(plan: Plan) -> tuple[str, ...]:
    """Return tests in an order whose heights are nearly uncorrelated with drift.

    First priority is a correlation below `LARGEST_LEAK` with linear drift, second with linear plus quadratic drift.
    Third are few ball set-ups, last few holder changes. Tests count as equal time steps. A local search exchanges and
    moves tests from several starts.
    """
    names = list(plan.tests)
    tests = [plan.tests[name] for name in names]
    balls = np.unique([test.ball.name for test in tests], return_inverse=True)[1]
    holders = np.unique([test.ball.holder for test in tests], return_inverse=True)[1]
    heights = np.array([test.circle.centre_mm[2] for test in tests])
    rng = np.random.default_rng(_SEED)
    first = [np.arange(len(names)), np.array([names.index(name) for name in by_holder(plan)])]
    found = [
        _improved(order, heights, balls, holders)
        for order in (*first, *(rng.permutation(len(names)) for _ in range(_STARTS)))
    ]
    costs = np.concatenate([_costs(order[None, :], heights, balls, holders) for order in found])
    return tuple(names[k] for k in found[_least(costs)])


def height_and_drift(heights_mm: Sequence[float], degree: int = 2) -> float:
    """Return the multiple correlation of heights with drift in equal time steps: 1 if inseparable, 0 if uncorrelated or heights are equal.

    Args:
        degree: 1: linear drift; 2: also quadratic.
    """
    return float(_correlations(np.array([heights_mm], dtype=np.float64), degree)[0])


def mountings(plan: Plan, names: Sequence[str]) -> int:
    """Return the number of set-ups in an order."""
    balls = [plan.tests[name].ball.name for name in names]
    return sum(k == 0 or balls[k] != balls[k - 1] for k in range(len(balls)))


def _improved(
    order: NDArray[np.intp], heights: Floats, balls: NDArray[np.intp], holders: NDArray[np.intp]
) -> NDArray[np.intp]:
    at = _costs(order[None, :], heights, balls, holders)[0]
    while True:
        near = _neighbours(order)
        costs = _costs(near, heights, balls, holders)
        best = _least(costs)
        if tuple(costs[best]) >= tuple(at):
            return order
        order, at = near[best], costs[best]


def _neighbours(order: NDArray[np.intp]) -> NDArray[np.intp]:
    n = len(order)
    near = [order]
    for i in range(n):
        rest = np.delete(order, i)
        near += [np.insert(rest, j, order[i]) for j in range(n) if j != i]
        for j in range(i + 2, n):
            swapped = order.copy()
            swapped[[i, j]] = swapped[[j, i]]
            near.append(swapped)
    return np.array(near)


def _costs(orders: NDArray[np.intp], heights: Floats, balls: NDArray[np.intp], holders: NDArray[np.intp]) -> Floats:
    in_order = heights[orders]
    leaks = [np.maximum(_correlations(in_order, degree) - LARGEST_LEAK, 0.0) for degree in (1, 2)]
    changes = [np.count_nonzero(np.diff(each[orders], axis=1), axis=1) for each in (balls, holders)]
    return np.stack([*(np.round(leak / _TINY) * _TINY for leak in leaks), *changes], axis=1)


def _least(costs: Floats) -> int:
    return int(np.lexsort(costs.T[::-1])[0])


def _correlations(heights: Floats, degree: int) -> Floats:
    """Return multiple correlations, shape (m,), of rows of heights, shape (m, n), with polynomials of the test's number."""
    n = heights.shape[1]
    off = heights - heights.mean(axis=1, keepdims=True)
    size = np.linalg.norm(off, axis=1)
    if n < 2 or not size.any():  # noqa: PLR2004 - one test has no order
        return np.zeros(len(heights))
    drift = np.vander(np.linspace(-1.0, 1.0, n), min(degree, n - 1) + 1, increasing=True)
    basis = np.linalg.qr(drift)[0][:, 1:]  # the first column is the mean, already removed
    return np.minimum(np.linalg.norm(off @ basis, axis=1) / size, 1.0)
