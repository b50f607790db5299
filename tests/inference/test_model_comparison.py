"""Marginal likelihoods of sets of causes against dense Gaussian integrals and against nested sampling."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import dblquad, quad
from scipy.special import logsumexp, ndtri
from scipy.stats import norm

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.model_comparison import (
    LOG_SCALE_WEIGHTS,
    MOST_SLACK,
    SCALES,
    Member,
    cholesky,
    with_slack_of,
)
from tests.inference.dense import Dense, cause, variant

NOISE = 0.4
T = np.linspace(0.0, 1.0, 50)
BASE = np.column_stack([np.ones(50), T])


def slacked(*columns, slack, slack_sd, plausible=1.0, **known):
    return variant(*columns, plausible=plausible, slack=np.array(slack), slack_sd=np.array(slack_sd), **known)


def members_of():
    """Three members: with slack, with two columns, with another size of its slack."""
    first = cause("first", slacked(0, 1, slack=[5, 6], slack_sd=[0.2, 0.1]))
    second = cause("second", variant(2, 3, plausible=0.5))
    third = cause("third", slacked(4, slack=[7], slack_sd=[0.3], plausible=2.0))
    return [
        Member(first, first.variants[0], 0.3),
        Member(second, second.variants[0], 3.0),
        Member(third, third.variants[0], 0.1, slack_scale=0.7),
    ]


def sd_of(member):
    """Prior standard deviations of a member, written out."""
    form = member.variant
    return np.r_[form.plausible * member.scale, form.slack_sd * member.slack_scale]


def columns_of(members):
    return np.concatenate([np.r_[m.variant.columns, m.variant.slack] for m in members]).astype(int)


@pytest.fixture
def problem(rng):
    columns = rng.normal(size=(50, 12)) + np.outer(np.sin(3 * T), rng.normal(size=12))
    target = BASE @ [5.0, -3.0] + columns[:, :5] @ [0.3, -0.2, 0.8, 0.1, 0.2] + rng.normal(0, NOISE, 50)
    return Dense(BASE, columns, target, NOISE)


@pytest.mark.parametrize("taken", [[0], [1], [0, 1], [2, 0], [0, 1, 2]])
def test_log_evidence_is_the_dense_gaussian_integral(problem, taken):
    members = [members_of()[k] for k in taken]
    sd = np.concatenate([sd_of(m) for m in members])
    expected = problem.log_evidence(columns_of(members), sd)
    assert problem.comparison().log_evidence(members) == pytest.approx(expected, abs=1e-9)


def test_nothing_more_than_the_base_has_no_evidence(problem):
    assert problem.comparison().log_evidence([]) == 0.0


def test_a_flat_base_is_the_limit_of_a_very_wide_one(rng):
    columns = rng.normal(size=(50, 2))
    target = BASE @ [5.0, -3.0] + columns @ [0.5, 0.0] + rng.normal(0, NOISE, 50)
    wide = Dense(np.zeros((50, 0)), np.hstack([BASE, columns]), target, NOISE)
    sd = np.r_[1e3, 1e3]
    expected = wide.log_evidence([0, 1, 2, 3], np.r_[sd, 0.3, 0.3]) - wide.log_evidence([0, 1], sd)
    both = cause("both", variant(0, 1))
    found = Dense(BASE, columns, target, NOISE).comparison().log_evidence([Member(both, both.variants[0], 0.3)])
    assert found == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("beside", [0, 1, 3])
def test_a_scan_averages_over_sizes_and_variants(problem, beside):
    members = members_of()[:beside]
    forms = (variant(8, log_weight=np.log(0.5)), variant(9, 10, plausible=0.5, log_weight=np.log(0.2)))
    wide = variant(11, plausible=4.0, log_weight=np.log(0.3))
    causes = [cause("several", *forms, wide), cause("one", slacked(11, slack=[8], slack_sd=[0.5]))]
    scan = problem.comparison().scan(members, causes)
    taken = columns_of(members) if members else np.zeros(0, dtype=int)
    sd = np.concatenate([np.zeros(0), *(sd_of(m) for m in members)])
    without = problem.log_evidence(taken, sd)
    for k, own in enumerate(causes):
        each = {
            (form, scale): problem.log_evidence(
                np.r_[taken, own.variants[form].columns], np.r_[sd, own.variants[form].plausible * scale]
            )
            - without
            for form in range(len(own.variants))
            for scale in SCALES
        }
        weighted = {
            key: value + own.variants[key[0]].log_weight + LOG_SCALE_WEIGHTS[list(SCALES).index(key[1])]
            for key, value in each.items()
        }
        best = max(weighted, key=weighted.get)
        assert scan.log_factor[k] == pytest.approx(logsumexp(list(weighted.values())), abs=1e-9)
        assert (scan.best[k].variant, scan.best[k].scale) == (own.variants[best[0]], best[1])
        assert scan.log_best[k] == pytest.approx(each[best], abs=1e-9)


def test_the_weights_of_sizes_are_probabilities():
    assert np.exp(LOG_SCALE_WEIGHTS).sum() == pytest.approx(1.0)


def test_the_best_narrow_form_is_given_where_a_flexible_one_is_better(rng):
    columns = rng.normal(size=(50, BOUNDS.flexible + 1))
    target = columns[:, : BOUNDS.flexible] @ rng.normal(size=BOUNDS.flexible) + 0.1 * rng.normal(size=50)
    both = cause("both", variant(*range(BOUNDS.flexible)), variant(0), variant(BOUNDS.flexible))
    scan = Dense(BASE, columns, target, 0.1).comparison().scan([], [both, cause("slim", variant(1))])
    assert scan.best[0].variant is both.variants[0]
    assert scan.narrow[0].variant in both.variants[1:]
    assert scan.narrow[1] is None


def test_evidence_of_pairs_is_that_of_members_and_pair_without_slack_of_these(problem):
    members, more = members_of()[:1], members_of()[1:]
    extra = cause("extra", variant(8, 9, plausible=0.3))
    more = [*more, Member(extra, extra.variants[0], 1.0)]
    for beside in ([], members):
        pairs, found = problem.comparison().log_evidence_of_pairs(beside, more)
        assert pairs.tolist() == [[0, 1], [0, 2], [1, 2]]
        for pair, value in zip(pairs, found, strict=True):
            added = [more[k] for k in pair]
            columns = np.concatenate(
                [columns_of(m for m in beside) if beside else []] + [m.variant.columns for m in added]
            )
            sd = np.concatenate([sd_of(m) for m in beside] + [m.variant.plausible * m.scale for m in added])
            assert value == pytest.approx(problem.log_evidence(columns.astype(int), sd), abs=1e-9)


def test_beside_is_what_members_leave_of_columns_under_their_priors(problem):
    members, wanted = members_of(), np.array([8, 9, 0])
    stacked = problem.columns[:, columns_of(members)]
    sd = np.concatenate([sd_of(m) for m in members])
    covariance = np.eye(len(problem.target)) + (stacked * sd / NOISE) @ (stacked * sd / NOISE).T
    own = problem.columns[:, wanted] / NOISE
    expected = own.T @ np.linalg.solve(covariance, own)
    assert problem.comparison().beside(members, wanted) == pytest.approx(expected, abs=1e-9)
    assert problem.comparison().beside([], wanted) == pytest.approx(own.T @ own)


def test_estimates_are_those_of_an_augmented_least_squares_fit(problem):
    members = members_of()
    sd = np.concatenate([sd_of(m) for m in members])
    rows = np.vstack([problem.columns[:, columns_of(members)] / NOISE, np.diag(1.0 / sd)])
    target = np.r_[problem.target / NOISE, np.zeros(len(sd))]
    found = problem.comparison().estimates(members)
    assert found.values == pytest.approx(np.linalg.lstsq(rows, target)[0], abs=1e-10)
    assert found.covariance == pytest.approx(np.linalg.inv(rows.T @ rows), abs=1e-10)
    least, without = np.sum((target - rows @ found.values) ** 2), problem.target @ problem.target / NOISE**2
    assert problem.comparison().explained(members) == pytest.approx(without - least, abs=1e-8)


def test_parameters_formula_and_parts_have_their_own_priors():
    """A formula ten times closer than stated fixes neither its parameters nor the differences between parts."""
    form = slacked(0, slack=[2, 3, 4, 5], slack_sd=[0.5, 0.2, 0.2, 0.4], tangents=1, parts=1)
    member = Member(cause("it", form), form, 3.0, slack_scale=0.1 * 1.2, slack_share=0.1, parts_share=1.0)
    assert member.sd == pytest.approx([3.0, 0.5 * 1.2, 0.02 * 1.2, 0.02 * 1.2, 0.4 * 1.2])


def test_slack_grows_with_the_amplitudes_up_to_a_bound():
    form = slacked(0, 1, slack=[2], slack_sd=[0.1], plausible=2.0, slack_at=0.5)
    member = Member(cause("it", form), form, 1.0)
    assert with_slack_of(member, np.array([0.6, 0.8])).slack_scale == pytest.approx(np.sqrt(0.125) / 0.5)
    assert with_slack_of(member, np.array([60.0, 80.0])).slack_scale == MOST_SLACK
    plain = members_of()[1]
    assert with_slack_of(plain, np.array([60.0, 80.0])) is plain


def nested(log_likelihood, dimensions, rng, live=120, steps=15):
    """Log evidence over the unit cube and its standard deviation [Skilling, Bayesian Analysis 1 (2006) 833].

    A point is replaced by a random walk of differential steps that starts at another one above its likelihood.
    """
    points = rng.random((live, dimensions))
    values = np.array([log_likelihood(p) for p in points])
    log_z = -np.inf
    dead: list[tuple[float, float]] = []
    for k in range(10_000):
        worst = int(values.argmin())
        weight = -k / live + np.log(-np.expm1(-1.0 / live))
        dead.append((weight, values[worst]))
        log_z = np.logaddexp(log_z, weight + values[worst])
        if values.max() - (k + 1) / live < log_z - 6.0:
            break
        at = (worst + rng.integers(1, live)) % live
        here, value = points[at], values[at]
        for _ in range(steps):
            a, b = points[rng.integers(live, size=2)]
            new = here + (a - b) * rng.exponential() + 1e-4 * rng.normal(size=dimensions)
            new = np.abs((new + 1.0) % 2.0 - 1.0)
            if (reached := log_likelihood(new)) > values[worst]:
                here, value = new, reached
        points[worst], values[worst] = here, value
    log_z = np.logaddexp(log_z, logsumexp(values) - np.log(live) - (k + 1) / live)
    weights, likely = np.array(dead).T
    spread = float(np.sum(np.exp(weights + likely - log_z) * (likely - log_z)))
    return float(log_z), float(np.sqrt(spread / live))


def scale_at(u):
    """Size as a function of a number between 0 and 1, by the prior's distribution function."""
    return SCALES[np.searchsorted(np.cumsum(np.exp(LOG_SCALE_WEIGHTS))[:-1], u)]


def decay(tau):
    return np.exp(-T / tau)


def test_one_amplitude_of_unknown_size(rng):
    single = Dense(BASE, decay(0.3)[:, None], BASE @ [1, 1] + 0.9 * decay(0.3) + rng.normal(0, NOISE, 50), NOISE)
    found = single.comparison().scan([], [cause("it", variant(0))]).log_factor[0]

    def likelihood(a):
        return np.exp(single.log_likelihood([0], np.array([a])))

    by_size = [quad(lambda a, s=s: likelihood(a) * norm.pdf(a, scale=s), -8 * s, 8 * s, limit=200)[0] for s in SCALES]
    assert found == pytest.approx(np.log(np.exp(LOG_SCALE_WEIGHTS) @ by_size), abs=1e-6)

    log_z, error = nested(lambda u: single.log_likelihood([0], ndtri(u[:1]) * scale_at(u[1])), 2, rng)
    assert error < 0.2
    assert found == pytest.approx(log_z, abs=3 * error)


def test_one_nonlinear_parameter_on_a_grid(rng):
    low, high, count = 0.05, 1.0, 16
    cells = np.geomspace(low, high, count + 1)
    grid = np.sqrt(cells[1:] * cells[:-1])
    target = BASE @ [1, 1] + 1.5 * decay(0.2) + rng.normal(0, NOISE, 50)
    on_grid = Dense(BASE, np.column_stack([decay(tau) for tau in grid]), target, NOISE)
    forms = [variant(k, log_weight=-np.log(count)) for k in range(count)]
    found = on_grid.comparison().scan([], [cause("it", *forms)]).log_factor[0]

    def log_likelihood(a, log_tau):
        left = on_grid.target - a * (on_grid.beside.T @ decay(np.exp(log_tau)))
        return 0.5 * (on_grid.target @ on_grid.target - left @ left) / NOISE**2

    ends = np.log([low, high])
    density = np.exp(LOG_SCALE_WEIGHTS)

    def integrand(a, log_tau):
        prior = density @ (np.exp(-0.5 * (a / SCALES) ** 2) / SCALES) / np.sqrt(2 * np.pi)
        return np.exp(log_likelihood(a, log_tau)) * prior / (ends[1] - ends[0])

    # In pieces, so that the spike of the smallest size at zero is not stepped over.
    by_quadrature = sum(
        dblquad(integrand, *ends, a, b, epsabs=0.0, epsrel=1e-4)[0]
        for a, b in ((-12.0, -0.2), (-0.2, 0.0), (0.0, 0.2), (0.2, 12.0))
    )
    assert found == pytest.approx(np.log(by_quadrature), abs=0.03)

    log_z, error = nested(
        lambda u: log_likelihood(ndtri(u[0]) * scale_at(u[1]), ends[0] + u[2] * (ends[1] - ends[0])),
        3,
        rng,
    )
    assert error < 0.25
    assert found == pytest.approx(log_z, abs=3 * error)


def test_two_causes_with_sizes_of_their_own(rng):
    columns = np.column_stack([decay(0.1), np.sin(7 * T)])
    pair = Dense(BASE, columns, BASE @ [1, 1] + columns @ [0.9, 0.4] + rng.normal(0, NOISE, 50), NOISE)
    both = [cause("decay", variant(0)), cause("wave", variant(1))]
    terms = [
        weight_a
        + weight_b
        + pair.comparison().log_evidence([Member(c, c.variants[0], s) for c, s in zip(both, (a, b), strict=True)])
        for a, weight_a in zip(SCALES, LOG_SCALE_WEIGHTS, strict=True)
        for b, weight_b in zip(SCALES, LOG_SCALE_WEIGHTS, strict=True)
    ]

    def log_likelihood(u):
        return pair.log_likelihood([0, 1], ndtri(u[:2]) * scale_at(u[2:]))

    log_z, error = nested(log_likelihood, 4, rng)
    assert error < 0.3
    assert logsumexp(terms) == pytest.approx(log_z, abs=3 * error)


def test_information_whose_rounding_is_negative_is_that_of_the_prior_there(rng: np.random.Generator) -> None:
    turned = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    lower = cholesky(turned @ np.diag([-0.15, 3.0, 79.0, 1e6]) @ turned.T)
    assert np.all(np.diag(lower) > 0.0)
    np.testing.assert_allclose(np.triu(lower, 1), 0.0, atol=1e-9)
    np.testing.assert_allclose(lower @ lower.T, turned @ np.diag([1.0, 3.0, 79.0, 1e6]) @ turned.T, atol=1e-7)


@pytest.mark.parametrize("left_out", [(), (0,), (1,), (2,), (0, 2), (0, 1, 2)])
def test_causes_around_a_hypothesis_are_those_beside_its_members_but_for_some(problem, left_out):
    members, fourth = members_of(), cause("fourth", variant(8), variant(9, 10, plausible=0.7))
    causes = [members[1].cause, fourth, members[0].cause, members[2].cause]
    left = [m for k, m in enumerate(members) if k not in left_out]
    scan, evidence = problem.comparison().around(members, causes).without([members[k].cause.name for k in left_out])
    known = problem.log_evidence(columns_of(left), np.concatenate([np.zeros(0), *map(sd_of, left)])) if left else 0.0
    assert evidence == pytest.approx(known, abs=1e-8)
    assert [c.name for c in scan.causes] == [c.name for c in causes if c.name not in {m.cause.name for m in left}]
    for one, factor, best in zip(scan.causes, scan.log_factor, scan.best, strict=True):
        every = np.array(
            [
                [
                    problem.log_evidence(
                        np.r_[form.columns, columns_of(left) if left else np.zeros(0, dtype=int)],
                        np.concatenate([form.plausible * scale, *map(sd_of, left)]),
                    )
                    - known
                    + form.log_weight
                    for scale in SCALES
                ]
                for form in one.variants
            ]
        )
        assert factor == pytest.approx(logsumexp(every + LOG_SCALE_WEIGHTS), abs=1e-7)
        form, scale = np.unravel_index(np.argmax(every + LOG_SCALE_WEIGHTS), every.shape)
        assert (best.variant, best.scale) == (one.variants[form], SCALES[scale])


def test_a_member_as_part_of_the_base_leaves_the_evidence_of_all_as_it_is(problem):
    """Also in a comparison of the causes of these members alone, whose columns keep their numbers."""
    members = members_of()
    local = problem.comparison().among([m.cause for m in members])
    sd = np.concatenate([sd_of(m) for m in members])
    expected = problem.log_evidence(columns_of(members), sd)
    assert local.log_evidence(members) == pytest.approx(expected, abs=1e-9)
    for k, member in enumerate(members):
        others = [*members[:k], *members[k + 1 :]]
        beside = local.beside_of(member)
        assert beside.log_evidence(others) == pytest.approx(expected, abs=1e-9)
        alone = problem.log_evidence(columns_of([member]), sd_of(member))
        assert beside.log_evidence([]) == pytest.approx(alone, abs=1e-9)
        assert beside.values(others) == pytest.approx(
            problem.comparison().estimates([*others, member]).values[: len(columns_of(others))], abs=1e-9
        )
