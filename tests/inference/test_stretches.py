"""Stretches of time: rounded edges, ends in noise that differs from row to row, and what turns with the direction of travel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr
from scipy.stats import t as student_t

from dbbstation.inference.bank import Bank
from dbbstation.inference.channel import Base, Channel
from dbbstation.inference.coloured import Coloured, Left, akaike_cost
from dbbstation.inference.forms import Clock, Stretches
from dbbstation.inference.patterns import Family
from dbbstation.inference.settle import settle
from dbbstation.inference.stretches import SHORTEST, _pattern, _squares_of_edges, refined
from tests.inference.reading import read_by_levels

ROWS = 1200


def made(residual, **more):
    """A channel of one block with a constant and a ramp as base."""
    time = np.arange(len(residual)) * 0.01
    base = Base.flat(("constant", "ramp"), np.column_stack([np.ones(len(time)), time]))
    return Channel(residual, "N", (slice(0, len(time)),), ("one",), (), base, time=time, static=(), **more)


def forms(settled):
    found = []
    for member in settled.best.members:
        pattern = settled.bank.patterns[member.cause.name]
        edges = np.column_stack([pattern.form.first, pattern.form.last])[: len(member.variant.columns)]
        found += [(pattern.family, *edge) for edge in edges.tolist()]
    return sorted(found, key=lambda one: one[1])


def test_a_stretch_is_the_difference_of_two_steps():
    """Gaussian edges, as of a mean over neighbouring rows, against their closed form."""
    rows = np.arange(40.0)
    column = Stretches((10.3,), (25.8,), lambda since: ndtr(since / 1.5)).columns(rows)[:, 0]
    assert column == pytest.approx(ndtr((rows - 10.3) / 1.5) - ndtr((rows - 25.8) / 1.5))
    endless = Stretches((10.3,), (np.inf,), lambda since: ndtr(since / 1.5)).columns(rows)[:, 0]
    assert endless == pytest.approx(ndtr((rows - 10.3) / 1.5))


def test_a_round_edge_is_found_between_two_rows(rng):
    clock = Clock(np.arange(ROWS, dtype=np.float64), lambda since: ndtr(since / 1.5), 60.0)
    pulse = ndtr((clock.rows - 400.3) / 1.5) - ndtr((clock.rows - 631.8) / 1.5)
    settled = settle(made(3.0 * pulse + rng.normal(0.0, 0.05, ROWS), clock=clock))
    ((family, first, last),) = forms(settled)
    assert family is Family.PULSES
    assert first == pytest.approx(400.3, abs=0.1)
    assert last == pytest.approx(631.8, abs=0.1)


def test_what_turns_with_the_direction_is_one_stretch(rng):
    direction = np.where(np.arange(ROWS) // 100 % 2 == 0, 1.0, -1.0)
    inside = (np.arange(ROWS) >= 250) & (np.arange(ROWS) < 850)
    settled = settle(made(1.0 * direction * inside + rng.normal(0.0, 0.2, ROWS), direction=direction))
    ((family, first, last),) = forms(settled)
    assert family is Family.PULSES_BY_DIRECTION
    assert first == pytest.approx(249.5, abs=2.0)
    assert last == pytest.approx(849.5, abs=2.0)


def test_noise_that_grows_is_measured_and_no_pulse_is_seen_in_it(rng):
    """Noise of 0.1 with 0.3 times a size on top of it, which is 1 in some stretches and 0 elsewhere."""
    size = (np.arange(ROWS) // 60 % 4 == 0).astype(float)
    sigma = np.hypot(0.1, 0.3 * size)
    channel = made(rng.normal(0.0, 1.0, ROWS) * sigma, grows=size)
    bank = Bank(channel)
    bank.measure()
    # A grid of ratios that are apart by factors of two.
    ratio = bank.spread[size > 0].mean() / bank.spread[size == 0].mean()
    assert np.sqrt(10.0) / np.sqrt(2.0) < ratio < np.sqrt(10.0) * np.sqrt(2.0)
    assert settle(channel).best.members == ()
    even = Bank(replace(channel, grows=None))
    even.measure()
    assert np.ptp(even.spread) == 0.0


def test_noise_that_is_the_same_everywhere_does_not_grow(rng):
    bank = Bank(made(rng.normal(0.0, 0.1, ROWS), grows=np.abs(np.sin(np.arange(ROWS) / 20.0))))
    bank.measure()
    assert np.ptp(bank.spread) == 0.0


def test_the_likelihood_of_uneven_noise_is_that_of_its_covariance(rng):
    """Differences between spreads and levels, against the restricted likelihood written out with dense matrices."""
    rows = 60
    residual = rng.normal(0.0, 0.3, rows)
    channel = made(residual)

    def dense(spread, level):
        covariance = np.diag((level * spread) ** 2)
        inverse = np.linalg.inv(covariance)
        base = channel.base.samples
        across = base.T @ inverse @ base
        rest = residual - base @ np.linalg.solve(across, base.T @ inverse @ residual)
        return -0.5 * (np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(across)[1] + rest @ inverse @ rest)

    cases = [(np.ones(rows), 0.3), (np.linspace(0.5, 1.5, rows), 0.3), (np.linspace(2.0, 0.4, rows), 0.2)]
    found = []
    for spread, level in cases:
        bank = Bank(channel)
        bank._take(bank.noise.with_innovation(level), spread, np.ones(rows))
        found.append(bank.log_likelihood())
    wanted = [dense(spread, level) for spread, level in cases]
    assert np.diff(found) == pytest.approx(np.diff(wanted), rel=1e-6)


def test_the_likelihood_of_long_tails_is_that_of_students_t(rng):
    """The gain over weighted normal rows and their part together, against SciPy's density of the same rows."""
    bank = Bank(replace(made(0.3 * rng.standard_t(3.0, 400)), time=None))
    bank.long_tails, bank.measures_beside_members = True, True
    bank.measure(())
    assert np.isfinite(bank.tails)
    assert np.ptp(bank.trust) > 0.0
    weighted = bank.beside().left(bank.target[:, None], bank._sizes(()))[:, 0] / bank.noise.innovation
    found = bank.log_level() - 0.5 * float(weighted @ weighted) + bank.tails_beyond(())
    rows = weighted / bank.trust * bank.noise.innovation
    wanted = student_t.logpdf(rows, bank.tails, scale=bank.noise.innovation).sum() + 0.5 * len(rows) * np.log(
        2.0 * np.pi
    )
    assert found == pytest.approx(wanted - akaike_cost(bank.noise.parameters + 1, len(rows)), abs=1e-6)


@pytest.mark.parametrize("edges", [(37.5, np.inf), (38.5, np.inf), (-np.inf, 0.5), (12.2, 12.4), (30.0, 30.0)])
def test_a_stretch_that_came_to_be_too_short_is_sought_among_long_enough_ones(rng, edges):
    rows = 40
    left = Left(rng.normal(0.0, 1.0, rows), np.zeros((rows, 0)), 1.0, Coloured(1.0), None)
    channel = made(np.zeros(rows))
    pattern = _pattern(Family.PULSES, (), [edges], channel.row_clock, np.ones(rows), 10.0)
    found = refined(pattern, left, np.ones(1), channel, 1.0)
    assert np.count_nonzero(found.samples[:, 0]) >= SHORTEST - 1


@pytest.mark.parametrize("longest", [5, 200])
def test_sums_of_squares_of_a_stretch_are_those_of_its_whitened_rows(longest):
    """By brute force: ones between zeros, filtered row by row."""
    noise = Coloured.first_order(1.0, 0.6, 0.8)
    taps = noise.filter
    found = _squares_of_edges(noise, longest)
    for length in range(1, longest + 1, 13):
        rows = np.concatenate([np.ones(length), np.zeros(len(taps))])
        whitened = np.convolve(rows, taps)[: len(rows)]
        assert found[length] + length * taps.sum() ** 2 == pytest.approx(float(whitened @ whitened))


def test_what_is_left_beside_columns_is_ridge_regression(rng):
    """[Hoerl and Kennard 1970]: normal equations with the precision of each prior, none where nothing is known."""
    columns, target, noise = rng.normal(size=(80, 6)), rng.normal(size=80), 0.7
    columns[:, 4] += 3.0 * columns[:, 0]
    sd = np.array([np.inf, np.inf, 1.0, 0.1, 3.0, np.inf])
    left = Left.of(columns, sd, target, Coloured(noise), None)
    precision = np.diag(np.where(np.isfinite(sd), 1.0 / sd**2, 0.0))
    values = np.linalg.solve(columns.T @ columns / noise**2 + precision, columns.T @ target / noise**2)
    np.testing.assert_allclose(left.rest, (target - columns @ values) / noise, atol=1e-12)


def test_what_is_left_beside_further_columns_is_ridge_regression(rng):
    rows, noise = 60, Coloured.first_order(0.7, 0.6, 0.8)
    whitening = noise.whitening([slice(0, rows)])
    dense, level = whitening.toarray(), noise.innovation
    base, columns, target = rng.normal(size=(rows, 2)), rng.normal(size=(rows, 4)), dense @ rng.normal(size=rows)
    columns[:, 3] = 0.0
    sd = np.array([np.inf, np.inf, 0.3, 1.0, 1.0, 0.5])
    for but_for in range(2, 6):
        used = np.delete(np.arange(6), but_for)
        whole = dense @ np.hstack([base, columns])[:, used]
        left = Left.of(whole[:, :2], sd[:2], target, noise, whitening).also(whole[:, 2:], sd[used][2:])
        inverse = np.linalg.inv(
            whole.T @ whole / level**2 + np.diag(np.where(np.isfinite(sd[used]), 1.0 / sd[used] ** 2, 0.0))
        )
        taken = whole @ inverse @ whole.T / level**2
        np.testing.assert_allclose(left.rest, (target - taken @ target) / level, atol=1e-11)
        np.testing.assert_allclose(left.axes @ left.axes.T, taken, atol=1e-11)
        np.testing.assert_allclose(left.beside, dense.T @ left.axes, atol=1e-11)


@pytest.mark.parametrize(
    ("here", "there"), [((5, 9), (5, 30)), ((0, 40), (0, 40)), ((36, 40), (36, 40)), ((7, 7), (7, 7))]
)
def test_a_part_of_whitened_rows_is_that_of_the_whole_matrix(rng, here, there):
    whitening = Coloured.first_order(0.7, 0.6, 0.8).whitening([slice(0, 15), slice(15, 40)])
    left = Left(np.zeros(40), np.zeros((40, 0)), 1.0, Coloured(1.0), whitening)
    rows = np.zeros((40, 3))
    rows[slice(*here)] = rng.normal(size=(here[1] - here[0], 3))
    found = left.whitened_part(rows[slice(*here)], slice(*here), slice(*there))
    np.testing.assert_allclose(found, (whitening.toarray() @ rows)[slice(*there)], atol=1e-14)


def test_a_single_row_is_no_stretch(rng):
    rows = 400
    residual = rng.normal(0.0, 1.0, rows)
    residual[200:203] += (12.0, 1.0, 0.0)
    base = Base.flat(("offset",), np.ones((rows, 1)))
    time = np.arange(rows, dtype=np.float64)
    channel = Channel(residual, "", (slice(0, rows),), ("one",), (), base, time=time)
    for finding in read_by_levels(settle(channel)):
        assert all(last - first + 1 >= SHORTEST for first, last in finding.rows)
