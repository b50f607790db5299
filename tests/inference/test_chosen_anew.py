"""Density of held-out parts against a Gaussian that is conditioned on the other rows."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from dbbstation.inference.folds import KnownGains, chosen_anew
from dbbstation.inference.hypotheses import search
from dbbstation.inference.levels import ABSENT, DensityGains
from dbbstation.inference.model_comparison import Member
from dbbstation.inference.projection import BesideBase, CauseColumns
from dbbstation.inference.square_root import Columns
from tests.inference.dense import cause, variant

NOISE, PARTS, ROWS = 0.3, 10, 12
WIDE = 1e3  # standard deviation of what is fitted freely, which stands for none at all

CAUSES = (
    cause("there", variant(0), odds=-3.0),
    cause("in one part", variant(1), odds=-3.0),
    cause("nowhere", variant(2), odds=-3.0),
)


@pytest.fixture
def rows(rng):
    """Base of a level and an offset per part, three causes, and a target with the first two of them."""
    part = np.repeat(np.arange(PARTS), ROWS)
    base = np.column_stack([np.ones(PARTS * ROWS), part[:, None] == np.arange(PARTS)])
    columns = rng.normal(size=(PARTS * ROWS, 3))
    columns[:, 1] *= part == 3
    target = (
        base @ np.r_[2.0, rng.normal(0.0, 0.5, PARTS)] + columns @ [0.4, 2.0, 0.0] + rng.normal(0.0, NOISE, len(part))
    )
    return part, base, columns, target


def comparisons(base, columns, target, part):
    every = CauseColumns(base)
    every.add(columns)
    known = Columns(np.r_[np.inf, np.full(PARTS, 0.5)], np.ones(1 + PARTS), np.arange(1 + PARTS) > 0)
    none = np.zeros((0, 1))
    of_all = BesideBase(every, known, none, NOISE).comparison(target)
    of_others = [
        BesideBase(every.but_for(part == k), known, none, NOISE).comparison(np.where(part == k, 0.0, target))
        for k in range(PARTS)
    ]
    return of_all, of_others


def density(base, columns, target, out):
    """Log density of some rows, given the others: base offsets, causes and noise as one Gaussian."""
    return _density(np.hstack([base * np.r_[WIDE, np.full(PARTS, 0.5)], columns]), target, out)


def _density(size, target, out):
    whole = size @ size.T + NOISE**2 * np.eye(len(target))
    across = np.linalg.solve(whole[np.ix_(~out, ~out)], whole[np.ix_(~out, out)])
    mean = across.T @ target[~out]
    return multivariate_normal.logpdf(target[out], mean, whole[np.ix_(out, out)] - whole[np.ix_(out, ~out)] @ across)


def test_gain_is_the_log_density_of_the_part_with_the_effect_less_that_without(rows):
    part, base, columns, target = rows
    of_all, of_others = comparisons(base, columns, target, part)
    chosen = [Member(CAUSES[0], CAUSES[0].variants[0], 1.0), Member(CAUSES[1], CAUSES[1].variants[0], 1.0)]
    found = chosen_anew(of_all, of_others, lambda _: chosen, lambda name: (name,))
    for k in range(PARTS):
        out = part == k
        both, first, second, neither = (
            density(base, columns[:, list(some)], target, out) for some in ((0, 1), (0,), (1,), ())
        )
        assert found[k]["there",] == pytest.approx(both - second, abs=1e-3)
        assert found[k]["in one part",] == pytest.approx(both - first, abs=1e-3)
        assert found[k][frozenset()] == pytest.approx(both - neither, abs=1e-3)


def test_what_is_in_one_part_alone_does_not_predict(rows):
    part, base, columns, target = rows
    of_all, of_others = comparisons(base, columns, target, part)
    best = search(of_all, CAUSES).best
    assert best.names == {"there", "in one part"}
    parts = chosen_anew(
        of_all, of_others, lambda c: search(c, CAUSES, [best.members]).best.members, lambda name: (name,)
    )
    found = KnownGains([part == k for k in range(PARTS)], parts, {frozenset(): 1.0}, 1.0)
    assert found.gains_of([("there",)]).predicts
    assert not found.is_worse
    once = found.gains_of([("in one part",)])
    assert once.parts[3] == 0.0
    assert not once.predicts


def test_what_brings_nothing_seldom_predicts(rng):
    """A useless effect that is chosen every time, in 400 data sets of forty rows: seldomer than sure things may be wrong."""
    parts, draws = np.arange(40) // 4, 400
    level = np.full((40, 1), WIDE)
    passed = 0
    for _ in range(draws):
        column = rng.normal(size=(40, 1))
        target = rng.normal(0.0, NOISE, 40)
        brought = []
        for part in range(PARTS):
            but_for, with_it = (_density(size, target, parts == part) for size in (level, np.hstack([level, column])))
            brought.append(with_it - but_for)
        passed += DensityGains(tuple(brought)).predicts
    assert passed <= ABSENT * draws


def test_a_class_that_nothing_follows_predicts_nothing():
    gains = KnownGains([], [], {}, 0.0)
    assert not gains.of({"time", "run"}).predicts
    assert gains.of({"time", "run"}).gains.total == 0.0
