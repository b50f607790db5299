"""How often causes are chosen again from parts of the measurement: sines on a line, answers by brute force."""

from __future__ import annotations

from collections import Counter
from itertools import combinations

import numpy as np
import pytest

from dbbstation.inference.blocks import Columns, compress
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.model_comparison import Variant
from dbbstation.inference.selection_frequency import SHARE, renumbered, selection_frequency
from tests.inference.dense import Dense, cause, variant
from tests.inference.subsets import log_posteriors

ODDS = float(np.log(0.05 / 0.95))
NOISE = 0.5
T = np.linspace(0.0, 1.0, 40, endpoint=False)
FLAT = Columns(np.full(2, np.inf), np.ones(2), np.zeros(2, dtype=bool))
NONE_HELD = np.zeros((0, 2))
BASE = np.column_stack([np.ones(40), T])
WAVES = np.column_stack([np.sin(2 * np.pi * T), np.cos(6 * np.pi * T), np.sign(np.sin(2 * np.pi * T)), T**2])
CAUSES = [cause(name, variant(k), odds=ODDS) for k, name in enumerate(("sine", "cosine", "square", "parabola"))]


def frequencies(rng, targets, groups, causes=CAUSES, columns=None):
    """Of runs that share base and causes' columns, or have columns of their own."""
    columns = [WAVES] * len(targets) if columns is None else columns
    blocks = [
        compress(np.arange(2 + own.shape[1]), np.hstack([BASE, own]), target)
        for own, target in zip(columns, targets, strict=True)
    ]
    return selection_frequency(blocks, groups, FLAT, NONE_HELD, causes, NOISE, rng)


def runs(rng, *amplitudes):
    return [BASE @ [3.0, -1.0] + WAVES @ a + rng.normal(0, NOISE, 40) for a in amplitudes]


def test_a_strong_cause_is_found_in_every_draw_and_what_is_absent_hardly_ever(rng):
    absent = []
    for _ in range(5):
        found = frequencies(rng, runs(rng, *[[1.5, 0.0, 0.0, 0.0]] * 6), range(6))
        assert found.pop("sine") == 1.0
        absent += found.values()
    assert set(found) == {"cosine", "square", "parabola"}
    assert np.mean(absent) < 0.02


def test_nothing_is_found_again_where_nothing_is(rng):
    found = [frequencies(rng, runs(rng, *[[0.0] * 4] * 6), range(6)).values() for _ in range(5)]
    # Four causes at prior odds of 1 to 19 against noise: the best set is hardly ever another than none.
    assert np.mean([list(one) for one in found]) < 0.02


def test_frequencies_are_the_shares_of_the_parts_in_which_brute_force_finds_a_cause():
    rng = np.random.default_rng(7)
    targets = runs(rng, [0.9, 0.0, 0.0, 0.0], [0.0, 0.8, 0.0, 0.0], [0.9, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0])
    kept = [*combinations(range(4), int(np.ceil(SHARE * 4)))]
    assert len(kept) == 4
    expected = Counter()
    for part in kept:
        base, columns = (np.tile(one, (3, 1)) for one in (BASE, WAVES))
        problem = Dense(base, columns, np.concatenate([targets[run] for run in part]), NOISE)
        posterior = log_posteriors(problem, CAUSES)
        expected.update(dict.fromkeys(max(posterior, key=posterior.get), 0.25))
    # The parts disagree, or there would be nothing to see.
    assert any(0.0 < share < 1.0 for share in expected.values())
    draws = [frequencies(np.random.default_rng(seed), targets, range(4)) for seed in range(10)]
    for one in CAUSES:
        # 200 draws: a share of three quarters is known to 0.03.
        assert np.mean([found[one.name] for found in draws]) == pytest.approx(expected[one.name], abs=0.11)


def test_each_group_is_kept_in_seven_of_ten_draws():
    rng = np.random.default_rng(3)
    targets = runs(rng, *[[0.0] * 4] * 10)
    nothing = np.zeros_like(WAVES)
    columns = [WAVES, *[nothing] * 9]
    targets[0] = targets[0] + 5.0 * WAVES[:, 0]
    found = [
        frequencies(np.random.default_rng(seed), targets, range(10), columns=columns)["sine"] for seed in range(10)
    ]
    assert np.mean(found) == pytest.approx(SHARE, abs=0.11)  # 200 draws: known to 0.03
    assert all(
        BOUNDS.selection_draws * share == pytest.approx(round(BOUNDS.selection_draws * share)) for share in found
    )


def test_draws_never_split_a_group():
    rng = np.random.default_rng(4)
    pairs = 10
    random = Columns(
        np.r_[np.full(2, np.inf), np.full(pairs, 50.0)], np.ones(2 + pairs), np.r_[False, False, np.ones(pairs, bool)]
    )
    half = np.sin(2 * np.pi * T)
    # Columns: base, one random sine of each pair, a cause in the first pair's difference, one in its first run alone.
    blocks = []
    for k in range(pairs):
        shift = rng.normal(0, 20.0)
        for sign in (1.0, -1.0):
            hidden = np.column_stack([sign * half, WAVES[:, 1] * (sign > 0)]) * (k == 0)
            jacobian = np.column_stack([BASE, half, hidden])
            target = jacobian @ [3.0, -1.0, shift, 2.0, 2.0] + rng.normal(0, NOISE, 40)
            blocks.append(compress(np.array([0, 1, 2 + k, 2 + pairs, 3 + pairs]), jacobian, target))
    causes = [cause("difference", variant(0), odds=ODDS), cause("alone", variant(1), odds=ODDS)]
    groups = [k // 2 for k in range(2 * pairs)]
    held = np.zeros((0, 2))
    found = [
        selection_frequency(blocks, groups, random, held, causes, NOISE, np.random.default_rng(seed))
        for seed in range(8)
    ]
    assert all(one["difference"] == one["alone"] for one in found)
    assert np.mean([one["alone"] for one in found]) == pytest.approx(SHARE, abs=0.13)  # 160 draws: known to 0.036
    # Runs that are drawn one by one do split it: then the difference is seen in fewer draws than the run alone.
    apart = [
        selection_frequency(blocks, range(2 * pairs), random, held, causes, NOISE, np.random.default_rng(seed))
        for seed in range(8)
    ]
    assert np.mean([one["difference"] for one in apart]) < np.mean([one["alone"] for one in apart]) - 0.1


def test_the_order_of_blocks_and_of_causes_does_not_matter():
    rng = np.random.default_rng(5)
    targets = runs(rng, *rng.normal(0, 0.5, (7, 4)))
    groups = [0, 0, 1, 2, 2, 3, 4]
    order = rng.permutation(7)
    first = frequencies(np.random.default_rng(1), targets, groups)
    shuffled = [targets[k] for k in order], [groups[k] for k in order]
    assert frequencies(np.random.default_rng(1), *shuffled) == first
    assert frequencies(np.random.default_rng(1), targets, groups, CAUSES[::-1]) == first
    assert any(0.0 < share < 1.0 for share in first.values())


def test_of_two_groups_both_are_kept(rng):
    targets = runs(rng, [0.0] * 4, [0.0] * 4)
    nothing = np.zeros_like(WAVES)
    targets[0], targets[1] = targets[0] + 5.0 * WAVES[:, 0], targets[1] + 5.0 * WAVES[:, 1]
    first, second = (WAVES * np.eye(4)[k] for k in (0, 1))
    found = frequencies(rng, targets, range(2), columns=[first + nothing, second + nothing])
    assert (found["sine"], found["cosine"]) == (1.0, 1.0)


def renamed():
    """Causes with columns far apart, slack, and a form that is part of another."""
    whole = np.array([40, 11])
    slack = {"slack": np.array([95, 7]), "slack_sd": np.array([0.3, 0.1])}
    many = Variant(whole, np.array([1.0, 2.0]), (8.0,), log_weight=-0.7, **slack)
    one = Variant(whole[1:], np.array([2.0]), (8.0,), "strut 2", "law", whole, -0.7)
    return [cause("many", many, one, odds=ODDS), cause("other", variant(60, plausible=3.0), odds=ODDS, named=False)]


def test_renumbering_keeps_every_column_and_all_else():
    before = renamed()
    wanted, after = renumbered(before)
    assert wanted.tolist() == [7, 11, 40, 60, 95]
    for old, new in zip(before, after, strict=True):
        assert (new.name, new.log_prior_odds, new.named) == (old.name, old.log_prior_odds, old.named)
        for was, found in zip(old.variants, new.variants, strict=True):
            for part in ("columns", "slack", "whole"):
                assert wanted[getattr(found, part)].tolist() == getattr(was, part).tolist()
            for kept in ("plausible", "slack_sd"):
                assert getattr(found, kept).tolist() == getattr(was, kept).tolist()
            for kept in ("nonlinear", "label", "law", "log_weight", "slack_at"):
                assert getattr(found, kept) == getattr(was, kept)


def test_renumbered_causes_are_found_as_often_as_before():
    rng = np.random.default_rng(6)
    wide = [rng.normal(size=(40, 96)) for _ in range(6)]
    targets = [BASE @ [3.0, -1.0] + 0.1 * own[:, 40] + 0.14 * own[:, 60] + rng.normal(0, NOISE, 40) for own in wide]
    causes = renamed()
    wanted, moved = renumbered(causes)
    before = frequencies(np.random.default_rng(2), targets, range(6), causes, wide)
    after = frequencies(np.random.default_rng(2), targets, range(6), moved, [own[:, wanted] for own in wide])
    assert after == before
    assert any(0.0 < share < 1.0 for share in before.values())
