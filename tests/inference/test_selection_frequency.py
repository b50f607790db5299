"""How often causes are chosen again from parts of the measurement: sines on a line, answers by brute force."""

from __future__ import annotations

from collections import Counter
from itertools import combinations

import numpy as np
import pytest

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.folds import SHARE, columns_of, selection_frequency
from dbbstation.inference.projection import BesideBase, CauseColumns
from dbbstation.inference.square_root import Columns
from tests.inference.dense import Dense, cause, variant
from tests.inference.subsets import log_posteriors

ODDS = float(np.log(0.05 / 0.95))
NOISE = 0.5
T = np.linspace(0.0, 1.0, 40, endpoint=False)
FLAT = Columns(np.full(2, np.inf), np.ones(2), np.zeros(2, dtype=bool))
BASE = np.column_stack([np.ones(40), T])
WAVES = np.column_stack([np.sin(2 * np.pi * T), np.cos(6 * np.pi * T), np.sign(np.sin(2 * np.pi * T)), T**2])
CAUSES = [cause(name, variant(k), odds=ODDS) for k, name in enumerate(("sine", "cosine", "square", "parabola"))]


def frequencies(rng, targets, groups, causes=CAUSES, columns=None):
    """Of runs that share base and causes' columns, or have columns of their own."""
    columns = [WAVES] * len(targets) if columns is None else columns
    return chosen_of(rng, np.tile(BASE, (len(targets), 1)), np.vstack(columns), targets, groups, FLAT, causes)


def chosen_of(rng, base, columns, targets, groups, known, causes):
    whole, target, lengths = CauseColumns(base), np.concatenate(targets), [len(own) for own in targets]
    whole.add(columns)
    held = np.zeros((0, 2))

    def without(runs):
        out = np.repeat(runs, lengths)
        part = whole.but_for(out, columns_of(causes))
        return BesideBase(part, known, held, NOISE).comparison(np.where(out, 0.0, target))

    return selection_frequency(groups, causes, without, rng)


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
    # Columns: base and one random sine of each pair; a cause in the first pair's difference, one in its first run alone.
    bases, columns, targets = [], [], []
    for k in range(pairs):
        shift = rng.normal(0, 20.0)
        for sign in (1.0, -1.0):
            bases.append(np.hstack([BASE, half[:, None] * (np.arange(pairs) == k)]))
            columns.append(np.column_stack([sign * half, WAVES[:, 1] * (sign > 0)]) * (k == 0))
            own = np.column_stack([BASE, half, columns[-1]])
            targets.append(own @ [3.0, -1.0, shift, 2.0, 2.0] + rng.normal(0, NOISE, 40))
    causes = [cause("difference", variant(0), odds=ODDS), cause("alone", variant(1), odds=ODDS)]
    groups = [k // 2 for k in range(2 * pairs)]
    given = np.vstack(bases), np.vstack(columns), targets
    found = [chosen_of(np.random.default_rng(seed), *given, groups, random, causes) for seed in range(8)]
    assert all(one["difference"] == one["alone"] for one in found)
    assert np.mean([one["alone"] for one in found]) == pytest.approx(SHARE, abs=0.13)  # 160 draws: known to 0.036
    # Runs that are drawn one by one do split it: then the difference is seen in fewer draws than the run alone.
    apart = [chosen_of(np.random.default_rng(seed), *given, range(2 * pairs), random, causes) for seed in range(8)]
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
