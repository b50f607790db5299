"""Orders of tests, against every order there is."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, permutations

import numpy as np
import pytest

from dbbstation.files.formats.plan import read_inline_plan, read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.plan import order
from dbbstation.plan.order import LARGEST_LEAK, against_drift, by_holder, height_and_drift, mountings
from dbbstation.plan.plan import Plan
from dbbstation.service.choice import Gate, Order, ordered

TABLE2 = shipped_folder("protocols") / "plans" / "table2.yaml"
HOLDERS = {"short": 0.0, "long": 142.0, "riser": 280.0}


def random_plan(seed: int, tests: int) -> Plan:
    rng = np.random.default_rng(seed)
    one = read_plan(TABLE2).tests["a"]
    drawn = {}
    for k in range(tests):
        holder = rng.choice(list(HOLDERS))
        ball = replace(one.ball, name=f"{rng.integers(1, 3)}-{holder}", holder=str(holder))
        circle = replace(one.circle, centre_mm=(0.0, 0.0, -1150.0 + HOLDERS[holder]))
        drawn[f"t{k}"] = replace(one, name=f"t{k}", ball=ball, circle=circle)
    return Plan("drawn", drawn)


def heights(plan: Plan, names: tuple[str, ...]) -> np.ndarray:
    return np.array([plan.tests[name].circle.centre_mm[2] for name in names])


def changes(values: list[str]) -> int:
    return sum(one != other for one, other in pairwise(values))


def remounts(plan: Plan, names: tuple[str, ...]) -> tuple[int, int]:
    balls = [plan.tests[name].ball for name in names]
    return changes([ball.name for ball in balls]), changes([ball.holder for ball in balls])


def leak(z_mm: np.ndarray, degree: int) -> float:
    t = np.arange(len(z_mm), dtype=float)
    total = float(np.sum((z_mm - z_mm.mean()) ** 2))
    if total == 0.0:
        return 0.0
    left = z_mm - np.polyval(np.polyfit(t, z_mm, degree), t)
    return float(np.sqrt(max(0.0, 1.0 - np.sum(left**2) / total)))


def cost(plan: Plan, names: tuple[str, ...]) -> tuple[float, ...]:
    z_mm = heights(plan, names)
    over = [round(max(leak(z_mm, degree) - LARGEST_LEAK, 0.0), 6) for degree in (1, 2)]
    return (*over, *remounts(plan, names))


@pytest.mark.parametrize("seed", range(6))
def test_by_holder_changes_balls_and_holders_as_seldom_as_any_order(seed):
    plan = random_plan(seed, 6)
    best = min(remounts(plan, names) for names in permutations(plan.tests))
    assert remounts(plan, by_holder(plan)) == best
    assert mountings(plan, by_holder(plan)) == len({test.ball.name for test in plan.tests.values()})


@pytest.mark.parametrize(("seed", "tests"), [(0, 4), (1, 5), (2, 5), (3, 6), (4, 6), (5, 6)])
def test_against_drift_is_as_good_as_the_best_of_all_orders(seed, tests):
    plan = random_plan(seed, tests)
    best = min(cost(plan, names) for names in permutations(plan.tests))
    found = against_drift(plan)
    assert sorted(found) == sorted(plan.tests)
    assert cost(plan, found) == pytest.approx(best, abs=2e-6)


def test_correlations_are_those_of_a_fit():
    z_mm = np.random.default_rng(3).normal(size=9)
    for degree in (1, 2):
        assert height_and_drift(z_mm, degree) == pytest.approx(leak(z_mm, degree))
    assert height_and_drift(z_mm, 1) == pytest.approx(abs(np.corrcoef(z_mm, np.arange(9))[0, 1]))
    # Trend-free by Prouhet, Thue and Morse: neither a steady drift nor one that bends shows in it.
    assert height_and_drift([0, 1, 1, 0, 1, 0, 0, 1]) == pytest.approx(0.0, abs=1e-12)
    assert height_and_drift([0, 0, 1, 1], 1) == pytest.approx(2.0 / np.sqrt(5.0))
    assert height_and_drift([5.0] * 4) == height_and_drift([7.0]) == 0.0


@pytest.mark.parametrize(("limit", "holder_changes"), [(0.02, 7), (0.05, 4), (0.1, 4)])
def test_table_ii_apart_from_drift(monkeypatch, limit, holder_changes):
    monkeypatch.setattr(order, "LARGEST_LEAK", limit)
    plan = read_plan(TABLE2)
    found = against_drift(plan)
    assert height_and_drift(heights(plan, tuple(plan.tests)), 1) == pytest.approx(0.9449, abs=1e-4)
    assert leak(heights(plan, found), 2) <= limit
    assert remounts(plan, found) == (14, holder_changes)
    assert found == against_drift(plan)


def test_a_drift_no_longer_looks_like_an_effect_of_height():
    """A steady drift of 10 µm, as the slope over the height that a fit would find, from the lowest to the highest test."""
    plan, seen = read_plan(TABLE2), {}
    for name, names in {"plan": tuple(plan.tests), "drift": against_drift(plan)}.items():
        z_mm, drift_um = heights(plan, names), np.linspace(-5.0, 5.0, len(names))
        seen[name] = abs(np.polyfit(z_mm, drift_um, 1)[0]) * np.ptp(z_mm)
    # Fifteen places, three blocks of five: the middles of the outer ones lie ten of fourteen steps apart.
    assert seen["plan"] == pytest.approx(10.0 * 10.0 / 14.0, rel=1e-3)
    assert seen["drift"] < 0.5


def test_what_is_repeated_at_the_end():
    plan = read_inline_plan(TABLE2)
    assert ordered(plan, Order.PLAN, Gate.FIRST).repeat_at_end == ("a",)
    assert ordered(plan, Order.PLAN, Gate.HOLDERS).repeat_at_end == ("a", "f", "k")
    found = ordered(plan, Order.DRIFT, Gate.FIRST)
    assert found.repeat_at_end == (found.tests[0].name,)
    own = ordered(found, Order.PLAN, Gate.HOLDERS)
    assert own.repeat_at_end == found.repeat_at_end
