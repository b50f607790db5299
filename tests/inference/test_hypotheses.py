"""The search over sets of causes against all sets and all sizes by brute force."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.hypotheses import FIT, SCAN, SearchWork, search
from dbbstation.inference.model_comparison import (
    SCALES,
    Around,
    Cause,
    Member,
    ModelComparison,
    Variant,
)
from tests.inference.dense import Dense, cause, variant
from tests.inference.subsets import inclusion, log_posteriors

ODDS = float(np.log(0.05 / 0.95))
T = np.linspace(0.0, 1.0, 40)
BASE = np.column_stack([np.ones(40), T])


def one_column_each(count, odds=ODDS):
    return [cause(f"c{k}", variant(k), odds=odds) for k in range(count)]


def probabilities(posterior, names):
    return np.array([posterior.probability([name]) for name in names])


@pytest.mark.parametrize(("alike", "noise"), [(0.0, 0.3), (1.0, 0.3), (3.0, 0.3), (0.0, 1.0), (3.0, 1.0)])
def test_probabilities_are_those_of_all_sets_and_all_sizes(rng, alike, noise):
    """Six causes, two of them there, columns more or less alike.

    Sizes are averaged over one cause at a time, the others at their best: that moved log posteriors by 0.07 at the most.
    Sets of several causes that are each not worth their odds are left out: that moved probabilities by 0.03.
    """
    causes = one_column_each(6)
    names = [c.name for c in causes]
    columns = rng.normal(size=(40, 6)) + alike * rng.normal(size=(40, 1))
    target = columns @ [0.0, 0.5, 0.0, 0.0, 0.2, 0.0] + rng.normal(0, noise, 40)
    problem = Dense(BASE, columns, target, noise)
    posterior = search(problem.comparison(), causes)
    full = log_posteriors(problem, causes)
    off = probabilities(posterior, names) - inclusion(full, names)
    top = posterior.best.log_posterior
    likely = [h for h in posterior.hypotheses if h.log_posterior > top - BOUNDS.likely]
    sizes = [h.log_posterior - full[h.names] for h in likely]
    assert posterior.best.names == max(full, key=full.get)
    # Who wants that one alone need not look so far.
    assert search(problem.comparison(), causes, likely=BOUNDS.close).best.names == posterior.best.names
    assert np.abs(off).max() < 0.05
    assert np.abs(sizes).max() < 0.2


def test_a_single_cause_is_scored_exactly(rng):
    columns = rng.normal(size=(40, 6))
    problem = Dense(BASE, columns, 0.5 * columns[:, 2] + rng.normal(0, 0.5, 40), 0.5)
    causes = one_column_each(6)
    posterior, full = search(problem.comparison(), causes), log_posteriors(problem, causes[:3])
    for key, expected in full.items():
        if len(key) < 2:
            assert posterior.weights[key] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(("off", "shares"), [(0.0, (0.1, 0.1)), (0.2, (0.1, 1.0))])
def test_a_law_and_the_differences_between_its_parts_have_their_own_shares(rng, off, shares):
    """Forty changes of the formula are not there; four differences between its parts are, or are not, as large as stated."""
    columns = rng.normal(size=(40, 45))
    parts, formula = np.arange(1, 5), np.arange(5, 45)
    slack = np.concatenate([formula, parts])
    law = cause("law", variant(0, slack=slack, slack_sd=np.full(len(slack), 0.2), parts=len(parts)), odds=0.0)
    target = columns[:, 0] + off * columns[:, parts] @ [1.0, -1.0, 0.8, -1.2] + rng.normal(0, 0.02, 40)
    problem = Dense(BASE, columns, target, 0.02)
    (member,) = search(problem.comparison(), [law]).best.members
    size = member.slack_scale / member.slack_share
    each = {
        (of_law, of_parts): problem.log_evidence(
            np.r_[0, slack], np.r_[member.scale, np.full(40, 0.2 * of_law * size), np.full(4, 0.2 * of_parts * size)]
        )
        for of_law, of_parts in ((0.1, 0.1), (0.1, 1.0), (1.0, 1.0))
    }
    assert (member.slack_share, member.parts_share) == max(each, key=each.get) == shares


def test_probabilities_add_up(rng):
    columns = rng.normal(size=(40, 4))
    problem = Dense(BASE, columns, 0.3 * columns[:, 1] + rng.normal(0, 0.5, 40), 0.5)
    posterior = search(problem.comparison(), one_column_each(4))
    shares = dict(zip(posterior.weights, posterior.shares, strict=True))
    assert sum(shares.values()) == pytest.approx(1.0)
    none = shares[frozenset()]
    assert posterior.probability(["c0", "c1", "c2", "c3"]) == pytest.approx(1.0 - none)
    assert posterior.probability(["of nobody"]) == 0.0


def test_three_loud_causes_among_many_are_found_at_once(rng):
    columns = rng.normal(size=(40, 60))
    causes = [cause(f"c{k}", variant(3 * k, 3 * k + 1, 3 * k + 2), odds=ODDS) for k in range(12)]
    there = np.zeros(60)
    there[[0, 1, 2, 9, 10, 11, 30, 31, 32]] = [0.9, 0.8, -0.7, 0.6, 0.8, 1.0, -0.9, 0.5, 0.7]
    problem = Dense(BASE, columns, columns @ there + rng.normal(0, 0.01, 40), 0.01)
    posterior = search(problem.comparison(), causes)
    assert posterior.best.names == {"c0", "c3", "c10"}
    assert all(posterior.probability([name]) > 0.999 for name in posterior.best.names)
    exact = problem.log_evidence([0, 1, 2, 9, 10, 11, 30, 31, 32], np.full(9, 1.0))
    assert posterior.best.log_posterior == pytest.approx(exact + 3 * ODDS + 3 * np.log(0.19), abs=2.0)


def test_two_causes_that_hide_each_other_are_found_together(rng):
    axes = np.linalg.qr(np.hstack([BASE, rng.normal(size=(40, 3))]))[0] * np.sqrt(40)
    common, own = axes[:, 2:3], axes[:, 3:]
    columns = np.hstack([common + 0.02 * own[:, :1], -common + 0.02 * own[:, 1:], rng.normal(size=(40, 4))])
    problem = Dense(BASE, columns, columns[:, 0] + columns[:, 1] + rng.normal(0, 0.01, 40), 0.01)
    causes = one_column_each(6)
    full = log_posteriors(problem, causes)
    assert max(full[frozenset({name})] for name in ("c0", "c1")) < 0.0
    assert max(full, key=full.get) == {"c0", "c1"}
    assert search(problem.comparison(), causes).best.names == {"c0", "c1"}


def test_a_flexible_cause_that_imitates_two_gives_way_to_them(rng):
    """It holds both almost exactly, with ten more columns, and is better than either of them alone."""
    two = rng.normal(size=(40, 2))
    columns = np.hstack([two, two + 0.01 * rng.normal(size=(40, 2)), rng.normal(size=(40, BOUNDS.flexible))])
    imitation = variant(*range(2, 2 + BOUNDS.flexible))
    causes = [*one_column_each(2), cause("flexible", imitation, odds=ODDS), cause("other", variant(15), odds=ODDS)]
    problem = Dense(BASE, columns, two @ [0.7, 0.9] + rng.normal(0, 0.05, 40), 0.05)
    comparison = problem.comparison()
    alone = comparison.scan([], causes).log_factor
    assert alone.argmax() == 2
    posterior = search(comparison, causes)
    full = log_posteriors(problem, causes)
    assert posterior.best.names == max(full, key=full.get) == {"c0", "c1"}
    assert posterior.probability(["flexible"]) == pytest.approx(inclusion(full, ["flexible"])[0], abs=0.01)


def test_a_law_that_is_not_quite_followed_takes_the_place_of_an_unnamed_effect(rng):
    """An unnamed effect of eight columns imitates a law and a small wave. The law alone leaves most of the wave."""
    columns = rng.normal(size=(40, 8))
    law, wave = cause("law", variant(0), odds=ODDS), cause("wave", variant(1), odds=ODDS, named=False)
    unnamed = cause("unnamed", variant(*range(8)), odds=ODDS, named=False)
    causes = [law, wave, unnamed]
    problem = Dense(BASE, columns, columns[:, 0] + 0.2 * columns[:, 1] + rng.normal(0, 0.02, 40), 0.02)
    comparison = problem.comparison()
    assert comparison.scan([], causes).log_factor.argmax() == 2
    full = log_posteriors(problem, causes)
    assert search(comparison, causes).best.names == max(full, key=full.get) == {"law", "wave"}


@pytest.mark.parametrize("amplitudes", [30, BOUNDS.wide + 1])
def test_factors_of_every_size_are_those_of_the_normal_density(rng, amplitudes):
    """However wide a form is: log N(target; 0, I + s² C C') - log N(target; 0, I), beside an empty base."""
    columns = rng.normal(size=(250, amplitudes))
    target = columns @ rng.normal(0, 0.2, amplitudes) + rng.normal(size=250)
    comparison = ModelComparison(columns.T @ columns, columns.T @ target)
    found = comparison.scan((), [cause("wide", variant(*range(amplitudes)))]).factors[0]
    for size, factor in zip(SCALES, found, strict=True):
        covariance = np.eye(250) + size**2 * columns @ columns.T
        explained = target @ target - target @ np.linalg.solve(covariance, target)
        assert factor == pytest.approx(0.5 * explained - 0.5 * np.linalg.slogdet(covariance)[1], abs=1e-7)


def test_no_set_has_two_forms_of_one_cause(rng):
    """Both forms of a law would explain what one form and a small wave explain."""
    columns = rng.normal(size=(40, 8))
    forms = [variant(0, log_weight=-np.log(2)), variant(1, log_weight=-np.log(2))]
    law, wave = cause("law", *forms, odds=ODDS), cause("wave", variant(1), odds=ODDS - 3.0, named=False)
    unnamed = cause("unnamed", variant(*range(8)), odds=ODDS, named=False)
    problem = Dense(BASE, columns, columns[:, 0] + 0.2 * columns[:, 1] + rng.normal(0, 0.02, 40), 0.02)
    posterior = search(problem.comparison(), [law, wave, unnamed])
    assert posterior.best.names == {"law", "wave"}
    assert all(len(one.members) == len(one.names) for one in posterior.hypotheses)


def test_a_seed_is_looked_at_in_the_form_that_its_cause_has_now(rng):
    own = rng.normal(size=(40, 3))
    hidden = np.column_stack([own[:, 0] - own[:, 1], own[:, 1] - own[:, 2], own[:, 2] - own[:, 0]])
    columns = np.hstack([hidden + 0.01 * rng.normal(size=(40, 3)), rng.normal(size=(40, 5))])
    problem = Dense(BASE, columns, columns[:, :3] @ np.ones(3) + rng.normal(0, 0.003, 40), 0.003)
    causes = one_column_each(6)
    forms = (variant(0, nonlinear=(1.0,), log_weight=-np.log(2)), variant(7, nonlinear=(5.0,), log_weight=-np.log(2)))
    causes[0] = cause("c0", *forms, odds=ODDS)
    before = cause("c0", variant(3, nonlinear=(1.4,)), odds=ODDS)
    seed = [Member(before, before.variants[0], 1.0), *(Member(c, c.variants[0], 1.0) for c in causes[1:3])]
    gone = cause("gone", variant(0))
    posterior = search(problem.comparison(), causes, [[*seed, Member(gone, gone.variants[0], 1.0)]])
    assert posterior.best.names == {"c0", "c1", "c2"}
    assert next(m for m in posterior.best.members if m.cause.name == "c0").variant is forms[0]


def test_what_a_hypothesis_says_of_its_members(rng):
    columns = rng.normal(size=(40, 4))
    problem = Dense(BASE, columns, columns[:, 0] + columns[:, 1] + rng.normal(0, 0.1, 40), 0.1)
    best = search(problem.comparison(), one_column_each(4)).best
    assert best.names == {"c0", "c1"}
    assert best.lean
    assert [m.cause.name for m in best.without("c0")] == ["c1"]
    full = log_posteriors(problem, one_column_each(2))
    expected = full[frozenset({"c0", "c1"})] - full[frozenset({"c1"})] - ODDS
    # The other's size is at its best, not averaged over.
    assert best.log_factor("c0") == pytest.approx(expected, abs=1.0)


def test_no_cause_at_all():
    problem = Dense(BASE, np.zeros((40, 1)), T, 0.1)
    posterior = search(problem.comparison(), [])
    assert posterior.best.names == frozenset()
    assert posterior.probability(["c0"]) == 0.0


def test_a_search_ends_where_the_most_probable_set_is_as_large_as_allowed(rng):
    columns = rng.normal(size=(40, 10))
    problem = Dense(BASE, columns, columns.sum(axis=1) + rng.normal(0, 0.01, 40), 0.01)
    causes = one_column_each(10)
    ended = search(problem.comparison(), causes, most_members=6)
    assert ended.at_limit
    assert len(ended.best.members) == 6
    whole = search(problem.comparison(), causes, most_members=11)
    assert not whole.at_limit
    assert whole.best.names == {c.name for c in causes}
    assert whole.weights == search(problem.comparison(), causes).weights


def test_scores_that_count_for_nothing_are_not_kept(rng):
    columns = rng.normal(size=(40, 12))
    problem = Dense(BASE, columns, 3.0 * columns[:, 4] + rng.normal(0, 0.1, 40), 0.1)
    posterior = search(problem.comparison(), one_column_each(12))
    looked_at = {h.names for h in posterior.hypotheses}
    top = posterior.best.log_posterior
    scored = {key: weight for key, weight in posterior.weights.items() if key not in looked_at}
    assert posterior.best.names == {"c4"}
    assert scored
    assert min(scored.values()) > top - BOUNDS.negligible


def test_pairs_that_are_replaced_are_counted(rng, monkeypatch):
    """Twelve causes are there, of rising size: one cause is tried in the place of the 28 least pairs of 66; among parts of none."""
    columns, sizes = rng.normal(size=(40, 14)), np.append(np.geomspace(0.5, 3.0, 12), [0.0, 0.0])
    problem = Dense(BASE, columns, columns @ sizes + rng.normal(0, 0.02, 40), 0.02)
    replaced, without = [], Around.without

    def counted(around, names):
        replaced.extend([tuple(names)] if len(names) == 2 else [])
        return without(around, names)

    monkeypatch.setattr(Around, "without", counted)
    causes = one_column_each(14)
    whole = search(problem.comparison(), causes).best
    assert whole.names == {f"c{k}" for k in range(12)}
    assert len(replaced) == BOUNDS.replaced < 66
    worth = dict(zip((m.cause.name for m in whole.members), whole.log_factors, strict=True))
    sums = sorted(worth[a] + worth[b] for a, b in combinations(worth, 2))
    assert max(worth[a] + worth[b] for a, b in replaced) <= sums[BOUNDS.replaced - 1] + 1e-6
    replaced.clear()
    again = search(problem.comparison(), causes, [whole.members], thorough=False)
    assert again.best.names == whole.names
    assert replaced == []


def test_work_is_counted_by_what_it_costs():
    """A fit by rows times columns squared, a scan by columns of all forms, a set by causes times columns; stages share evenly."""
    work = SearchWork(1000.0)
    work.fit(2_000, 300)
    assert work.spent == pytest.approx(2_000 * 300**2 / FIT)
    causes = [Cause(f"c{k}", (Variant(np.arange(3 * k, 3 * k + 3), np.ones(3)),), 0.0) for k in range(4)]
    before = work.spent
    work.scan(causes, 5)
    assert work.spent - before == pytest.approx(5 * 12 * SCAN)
    before = work.spent
    work.examine([Member(cause, cause.variants[0], 1.0) for cause in causes])
    assert work.spent - before == 4 * 12
    part, before = work.part(3), work.spent
    assert part.most == pytest.approx((1000.0 - before) / 3.0)
    part.fit(1_000, 300)
    assert part.is_spent
    # What a stage spends is spent of the whole.
    assert work.spent == pytest.approx(before + part.spent)
    assert not work.is_spent
