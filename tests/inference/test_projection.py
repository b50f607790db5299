"""Causes beside a base against explicit least squares with the base's priors as further rows."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import cho_solve, null_space

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.model_comparison import Member
from dbbstation.inference.projection import BesideBase, CauseColumns, _factored
from dbbstation.inference.square_root import Columns
from tests.inference.dense import cause, variant

NOISE = 0.2
SAMPLES = 80

# Fitted columns, one of them within a tolerance, between random effects with a prior.
PRIOR = np.array([np.inf, 0.5, np.inf, 0.03, 2.0, np.inf, np.inf])
SCALE = np.array([1.0, 1.0, 3.0, 0.1, 1.0, 0.5, 2.0])
RANDOM = np.array([False, True, False, False, True, False, False])
FITTED = np.flatnonzero(~RANDOM)
KNOWN = Columns(PRIOR, SCALE, RANDOM)


@pytest.fixture
def samples(rng):
    """Base, causes and target, none of them orthogonal to another."""
    common = rng.normal(size=(SAMPLES, 1))
    base = rng.normal(size=(SAMPLES, len(PRIOR))) + common
    causes = rng.normal(size=(SAMPLES, 5)) + base @ rng.normal(size=(len(PRIOR), 5)) * 0.2
    target = base @ (0.1 * rng.normal(size=len(PRIOR))) + causes @ rng.normal(size=5) + rng.normal(0, NOISE, SAMPLES)
    return base, causes, target


def held_rows(rng, count):
    return np.linalg.qr(rng.normal(size=(len(FITTED), count)))[0].T


def penalties(held):
    """Rows whose squares are what the priors of the base say, in units of the noise's, columns as in the base.

    A stated standard deviation is a row of its own, and so is a held direction, whose coefficient in units of the
    scales has a standard deviation of one.
    """
    rows = np.diag(1.0 / PRIOR)[np.isfinite(PRIOR)]
    along = np.zeros((len(held), len(PRIOR)))
    along[:, FITTED] = held / SCALE[FITTED]
    return NOISE * np.vstack([rows, along])


def left_by_base(base, held, columns):
    """Columns with rows of zeros for the priors, less their least-squares fit by the base."""
    penalty = penalties(held)
    rows = np.vstack([base, penalty])
    padded = np.vstack([columns, np.zeros((len(penalty), columns.shape[1]))])
    return padded - rows @ np.linalg.lstsq(rows, padded)[0]


def compared(base, causes, target, known, held):
    """Products of columns and target that the comparison was given."""
    columns = CauseColumns(base)
    columns.add(causes)
    return products(BesideBase(columns, known, held, NOISE).comparison(target), causes.shape[1])


def products(comparison, count):
    return comparison.beside([], np.arange(count)), comparison._towards


@pytest.mark.parametrize("directions", [0, 1, 2])
def test_the_base_is_projected_out_with_its_priors(samples, rng, directions):
    base, causes, target = samples
    held = held_rows(rng, directions)
    gram, towards = compared(base, causes, target, KNOWN, held)
    left = left_by_base(base, held, np.column_stack([causes, target]))
    assert gram == pytest.approx(left[:, :-1].T @ left[:, :-1] / NOISE**2, rel=1e-9, abs=1e-8)
    assert towards == pytest.approx(left[:, :-1].T @ left[:, -1] / NOISE**2, rel=1e-9, abs=1e-8)


def test_a_flat_base_is_projected_out_wholly(samples):
    base, causes, target = samples
    flat = Columns(np.full(len(PRIOR), np.inf), SCALE, np.zeros(len(PRIOR), dtype=bool))
    gram, towards = compared(base, causes, target, flat, np.zeros((0, len(PRIOR))))
    beside = null_space(base.T)
    assert gram == pytest.approx(causes.T @ beside @ beside.T @ causes / NOISE**2, abs=1e-8)
    assert towards == pytest.approx(causes.T @ beside @ beside.T @ target / NOISE**2, abs=1e-8)


def test_a_badly_conditioned_base_loses_no_digits(samples):
    """Two columns that differ by 1e-6: their products alone would lose twelve digits."""
    base, causes, target = samples
    base = base.copy()
    base[:, 5] = base[:, 6] + 1e-6 * base[:, 5]
    gram, _ = compared(base, causes, target, KNOWN, held=np.zeros((0, len(FITTED))))
    left = left_by_base(base, np.zeros((0, len(FITTED))), causes)
    assert gram == pytest.approx(left.T @ left / NOISE**2, rel=1e-6)


def test_the_evidence_beside_random_effects_is_the_dense_integral(samples):
    base, causes, target = samples
    known = Columns(np.full(len(PRIOR), 0.3), SCALE, np.ones(len(PRIOR), dtype=bool))
    columns = CauseColumns(base)
    numbers = columns.add(causes)
    comparison = BesideBase(columns, known, np.zeros((0, 0)), NOISE).comparison(target)
    one = cause("one", variant(*numbers[:2]))

    def log_marginal(size):
        covariance = NOISE**2 * np.eye(SAMPLES) + 0.09 * base @ base.T + size**2 * causes[:, :2] @ causes[:, :2].T
        _, logdet = np.linalg.slogdet(covariance)
        return -0.5 * (logdet + target @ np.linalg.solve(covariance, target))

    found = comparison.log_evidence([Member(one, one.variants[0], 0.1)])
    assert found == pytest.approx(log_marginal(0.1) - log_marginal(0.0), abs=1e-8)


@pytest.mark.parametrize("directions", [0, 2])
def test_what_base_and_causes_leave_is_what_a_ridge_fit_leaves(samples, rng, directions):
    base, causes, target = samples
    held = held_rows(rng, directions)
    columns = CauseColumns(base)
    columns.add(causes)
    targets = np.column_stack([target, rng.normal(size=SAMPLES)])
    sd = np.array([0.5, 0.0, 2.0, 0.1, 0.0])
    found = BesideBase(columns, KNOWN, held, NOISE).left(targets, sd)
    own = sd > 0.0
    every = np.hstack([base, causes[:, own]])
    penalty = penalties(held)
    priors = np.zeros((len(penalty) + own.sum(), every.shape[1]))
    priors[: len(penalty), : len(PRIOR)] = penalty
    priors[len(penalty) :, len(PRIOR) :] = NOISE * np.diag(1.0 / sd[own])
    padded = np.vstack([targets, np.zeros((len(priors), 2))])
    fitted = np.linalg.lstsq(np.vstack([every, priors]), padded)[0]
    assert found == pytest.approx(targets - every @ fitted, abs=1e-10)


def test_columns_that_come_later_count_as_those_that_were_there(samples, rng):
    """Also beyond the room that is made at first, and where a comparison was made in between."""
    base, _, target = samples
    causes = rng.normal(size=(SAMPLES, BOUNDS.columns_at_first + 60))
    columns = CauseColumns(base)
    first = columns.add(causes[:, :3])
    beside = BesideBase(columns, KNOWN, np.zeros((0, len(FITTED))), NOISE)
    early, _ = products(beside.comparison(target), 3)
    later = [columns.add(causes[:, a:b]) for a, b in ((3, 40), (40, 40), (40, BOUNDS.columns_at_first + 60))]
    assert np.array_equal(np.concatenate([first, *later]), np.arange(BOUNDS.columns_at_first + 60))
    found = products(beside.comparison(target), BOUNDS.columns_at_first + 60)
    at_once = compared(base, causes, target, KNOWN, np.zeros((0, len(FITTED))))
    assert found[0] == pytest.approx(at_once[0], abs=1e-7)
    assert found[1] == pytest.approx(at_once[1], abs=1e-7)
    assert early == pytest.approx(at_once[0][:3, :3], abs=1e-7)
    assert columns.gram == pytest.approx(causes.T @ causes)


@pytest.mark.parametrize(("alone", "only"), [(False, None), (True, None), (True, np.array([0, 2, 4]))])
def test_rows_that_are_held_back_say_nothing(samples, rng, alone, only):
    base, causes, target = samples
    out = np.zeros(SAMPLES, dtype=bool)
    out[25:45] = True
    if alone:
        base = base.copy()
        base[~out, 1] = 0.0
    held = held_rows(rng, 1)
    whole, others = CauseColumns(base), CauseColumns(base[~out])
    whole.add(causes)
    others.add(causes[~out])
    members = [Member(cause("a", variant(0, 2)), variant(0, 2), 1.0), Member(cause("b", variant(4)), variant(4), 0.3)]
    held_back = BesideBase(whole.but_for(out, only), KNOWN, held, NOISE).comparison(np.where(out, 0.0, target))
    expected = BesideBase(others, KNOWN, held, NOISE).comparison(target[~out])
    assert held_back.log_evidence(members) == pytest.approx(expected.log_evidence(members), rel=1e-8)
    assert held_back.estimates(members).values == pytest.approx(expected.estimates(members).values, rel=1e-8)
    assert whole.samples == pytest.approx(causes)


def test_columns_take_the_places_of_those_that_were_given_back(samples, rng):
    base, causes, target = samples
    columns = CauseColumns(base)
    columns.add(causes)
    held = held_rows(rng, 0)
    before = BesideBase(columns, KNOWN, held, NOISE).comparison(target)
    members = [Member(cause("a", variant(0, 2)), variant(0, 2), 1.0)]
    evidence = before.log_evidence(members)
    columns.give_back(np.array([1, 3]))
    more = rng.normal(size=(SAMPLES, 3))
    assert columns.add(more).tolist() == [1, 3, causes.shape[1]]
    now = np.column_stack([causes, more[:, 2]])
    now[:, [1, 3]] = more[:, :2]
    assert columns.samples == pytest.approx(now)
    assert columns.gram == pytest.approx(now.T @ now)
    assert columns.along == pytest.approx(columns.axes.T @ now)
    # What was compared before is as it was.
    assert before.log_evidence(members) == evidence
    columns.give_back(np.array([0]))
    other = columns.copy()
    other.add(more[:, :1])
    columns.add(more[:, :1])
    assert columns.samples[:, 0] == pytest.approx(now[:, 0])
    assert other.samples[:, 0] == pytest.approx(now[:, 0])


@pytest.mark.parametrize("only", [None, np.array([0, 2, 3])])
def test_a_comparison_leaves_the_products_of_the_next_as_they_were(samples, rng, only):
    """Products are worked on where they are; a second comparison about the same causes is a least-squares fit as well."""
    base, causes, target = samples
    held, out = held_rows(rng, 1), np.arange(SAMPLES) % 3 == 0
    columns = CauseColumns(base)
    columns.add(causes)
    own = np.arange(causes.shape[1]) if only is None else only
    kept = BesideBase(columns.but_for(out, only), KNOWN, held, NOISE)
    left = left_by_base(base * ~out[:, None], held, causes[:, own] * ~out[:, None])
    for whole in (False, True):
        beside = BesideBase(columns, KNOWN, held, NOISE) if whole else kept
        expected = left_by_base(base, held, causes) if whole else left
        for _ in range(2):
            comparison = beside.comparison(target if whole else np.where(out, 0.0, target))
            gram = comparison.beside([], np.arange(causes.shape[1]) if whole else own)
            assert np.allclose(gram, expected.T @ expected / NOISE**2, rtol=1e-8)


@pytest.mark.parametrize("least", [1.5, -0.15])
def test_products_are_factored_in_place_or_as_the_prior_is_where_rounding_is_negative(rng, least):
    turned = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    products, target = turned @ np.diag([3.0, 79.0, 1e4, least]) @ turned.T, rng.normal(size=4)
    wanted = turned @ ((turned.T @ target) / [3.0, 79.0, 1e4, max(least, 1.0)])
    factor = _factored(np.asfortranarray(0.5 * (products + products.T)))
    np.testing.assert_allclose(cho_solve(factor, target), wanted, rtol=1e-9)
