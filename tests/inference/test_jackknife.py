"""The jackknife against closed forms and against the spread of many fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.facts.value import Value
from dbbstation.inference.folds import refits_without, weighted_jackknife, widening
from dbbstation.inference.read_off import with_jackknife
from dbbstation.inference.settle import settle
from tests.inference.tables import table
from tests.inference.test_channel import EFFECTS, channel


def means_without(target, parts):
    """Mean and its variance for white noise of one, from all rows and without each part."""
    values = [np.delete(target, rows).mean() for rows in parts]
    variances = [1.0 / (len(target) - len(rows)) for rows in parts]
    one = np.array([target.mean()]), np.array([1.0 / len(target)])
    return *one, np.array(values)[:, None], np.array(variances)[:, None]


def test_weighted_with_equal_parts_it_is_that_of_the_means(rng):
    target = rng.normal(3.0, 2.0, 400)
    parts = np.array_split(np.arange(400), 20)
    means = target.reshape(20, 20).mean(axis=1)
    found = weighted_jackknife(*means_without(target, parts))
    assert found == pytest.approx(np.sqrt(means.var(ddof=1) / 20), rel=1e-9)


def test_weighted_with_unequal_parts_its_square_is_the_variance(rng):
    """Of white noise, over 3,000 draws; one part has half of the rows."""
    parts = [np.arange(200), *np.array_split(np.arange(200, 400), 5)]
    squares = [weighted_jackknife(*means_without(rng.standard_normal(400), parts))[0] ** 2 for _ in range(3000)]
    assert np.mean(squares) == pytest.approx(1.0 / 400.0, rel=4.0 * np.std(squares) / np.mean(squares) / np.sqrt(3000))


def test_weighted_what_one_part_alone_knows_stays_as_it_is_stated():
    for unknown in (np.inf, 1e12):
        found = weighted_jackknife(
            np.array([5.0]), np.array([0.01]), np.array([[0.0], [5.0]]), np.array([[unknown], [0.01]])
        )
        assert found[0] < 0.01


def test_refits_are_those_of_the_rows_that_are_left():
    settled = settle(channel(table(2, EFFECTS["hysteresis of q"], rows=600)))
    bank, (member,) = settled.bank, settled.best.members
    parts = [np.arange(600) // 60 == k for k in range(10)]
    columns, noise = np.hstack([bank.base, bank.fitted(member.columns)]), settled.noise.innovation
    priors = np.hstack([np.zeros((len(member.sd), 1)), np.diag(noise / member.sd)])
    for rows, refit in zip(parts, refits_without(settled, parts), strict=True):
        stacked = np.vstack([columns[~rows], priors])
        values, *_ = np.linalg.lstsq(stacked, np.concatenate([bank.target[~rows], np.zeros(len(priors))]), rcond=None)
        assert refit.x == pytest.approx(values, rel=1e-6)
        spread = noise**2 * np.linalg.inv(stacked.T @ stacked)
        assert np.diag(refit.covariance) == pytest.approx(np.diag(spread), rel=1e-6)


def line_fits(rng, draws, shared_sd):
    """Values, stated and widened covariances of straight lines over ten groups that share an error each, which the model lacks."""
    columns = np.column_stack([np.ones(200), np.linspace(-1.0, 1.0, 200) + 3.0])
    groups = np.arange(200) % 10
    stated = np.linalg.inv(columns.T @ columns)
    kept = [groups != g for g in range(10)]
    without = np.array([np.linalg.inv(columns[k].T @ columns[k]) for k in kept])
    variances = np.diag(stated), np.diagonal(without, axis1=1, axis2=2)
    values, wide = [], []
    for _ in range(draws):
        shared = shared_sd * rng.normal(size=10)
        noise = rng.normal(size=200) + shared[groups] * columns[:, 1]
        found = stated @ columns.T @ noise
        others = np.array([own @ columns[k].T @ noise[k] for own, k in zip(without, kept, strict=True)])
        factor = widening(variances[0], others - found, variances[1])
        values.append(found)
        wide.append(np.outer(factor, factor) * stated)
    return np.array(values), stated, np.array(wide)


def test_widened_covariance_covers_what_groups_share_and_the_model_lacks(rng):
    """Against the spread of 400 fits. Combinations, such as the level in the middle, are covered better, though not fully."""
    values, stated, wide = line_fits(rng, 400, 1.0)
    u = np.sqrt(np.diagonal(wide, axis1=1, axis2=2))
    level = np.array([1.0, 3.0])
    assert np.mean(np.abs(values[:, 1]) < 2.0 * np.sqrt(stated[1, 1])) < 0.6
    assert np.mean(np.abs(values @ level) < 2.0 * np.sqrt(level @ stated @ level)) < 0.2
    assert np.all(np.mean(np.abs(values) < 2.0 * u, axis=0) > 0.88)
    assert np.mean(np.abs(values @ level) < 2.0 * np.sqrt(level @ wide @ level)) > 0.65


def test_widening_hardly_changes_what_the_model_states_rightly(rng):
    _, stated, wide = line_fits(rng, 400, 0.0)
    ratio = np.sqrt(np.diagonal(wide, axis1=1, axis2=2) / np.diag(stated))
    assert np.all(ratio >= 1.0 - 1e-12)
    assert np.all(np.mean(ratio, axis=0) < 1.2)
    level = np.array([1.0, 3.0])
    assert np.mean(np.sqrt(level @ wide @ level / (level @ stated @ level))) < 1.5


def test_widening_leaves_what_is_held():
    moved = np.array([[4.0, 0.0], [-4.0, 0.0], [0.5, 0.0]])
    assert widening(np.array([1.0, 0.0]), moved, np.ones((3, 2)) * [2.0, 0.0])[1] == 1.0


def test_a_value_that_moves_with_what_is_chosen_beside_it_has_the_jackknife_uncertainty_of_that():
    groups = np.random.default_rng(5).normal(0.3, 0.1, 10)
    without = [{"size": Value((groups.sum() - one) / 9.0, 0.01, "mm")} for one in groups]
    whole = {"size": Value(float(groups.mean()), 0.01, "mm"), "limit": Value(1.0, 0.02, "mm")}
    found = with_jackknife(whole, without, 0.9)
    assert found["size"].uncertainty == pytest.approx(groups.std(ddof=1) / np.sqrt(10.0))  # of a mean
    assert found["limit"] == whole["limit"]
    vague = [{"size": replace(one["size"], uncertainty=1e3)} for one in without]
    assert with_jackknife(whole, vague, 0.9) == whole
