"""Density of parts that were held back, against SciPy's normal densities of the whole covariance."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.stats import multivariate_normal, norm
from scipy.stats import t as student

from dbbstation.diagnosis.simulator import held as held_parts
from dbbstation.diagnosis.simulator.model import Model, Output, SimulatorParameter
from dbbstation.inference.channel import Base, Channel
from dbbstation.inference.coloured import Coloured

ROWS = 120


def stood_for(monkeypatch, noise, tails, spread, known=None):
    """A channel whose last rows are held back, simulations, and the covariance of all rows; the noise is given, not measured."""
    held = np.arange(ROWS) >= ROWS - 30
    outputs = (np.arange(ROWS) % 60 >= 30).astype(int)  # two outputs in two runs
    blocks = tuple(slice(k, k + 30) for k in range(0, ROWS, 30))
    base = Base((), np.zeros((ROWS, 0)), np.zeros(0), np.zeros(0, dtype=bool))
    channel = Channel(np.zeros(ROWS), "m", blocks, ("",) * 4, (), base, time=np.arange(ROWS) * 1.0, kept=~held)
    whitening = noise.whitening(channel.stretches)

    def whitened(values):
        rows = (values[~held].T / spread[outputs[~held]]).T
        return rows if whitening is None else whitening @ rows

    seen = spread[outputs[~held]]
    bank = SimpleNamespace(channel=channel, noise=noise, tails=tails, spread=seen, whitened=whitened)
    monkeypatch.setattr(held_parts, "noise_left", lambda *_args, **_named: bank)
    parameters = SimulatorParameter("a", "a", 0.0, uncertainty=known), SimulatorParameter("b", "b", 0.0)
    work = SimpleNamespace(output=outputs, model=Model("", parameters, (), (Output("x", "m"), Output("y", "m")), ()))
    return work, channel, held, outputs


@pytest.mark.parametrize("known", [None, 0.02])
@pytest.mark.parametrize("decay", [0.0, 0.95])
def test_a_part_is_as_probable_as_its_whole_covariance_says(monkeypatch, decay, known):
    rng, spread = np.random.default_rng(3), np.array([1.0, 2.5])
    noise = Coloured.first_order(0.1, 0.8, decay) if decay else Coloured(0.1)
    work, channel, held, outputs = stood_for(monkeypatch, noise, np.inf, spread, known)
    columns, residual = rng.normal(size=(ROWS, 2)), 0.2 * rng.normal(size=ROWS)
    # White noise on top of a first-order process, for each block of 30 rows.
    lags = np.arange(30)
    of_block = 0.01 * toeplitz(np.where(lags == 0, 1.0, 0.8 * decay**lags if decay else 0.0))
    whole = np.kron(np.eye(4), of_block) * np.outer(spread[outputs], spread[outputs])
    fitted, said = columns[~held], np.linalg.inv(whole[np.ix_(~held, ~held)])
    prior = np.diag([0.0 if known is None else known**-2, 0.0])
    open_ = np.linalg.inv(fitted.T @ said @ fitted + prior)
    covariance = whole[np.ix_(held, held)] + columns[held] @ open_ @ columns[held].T
    expected = multivariate_normal.logpdf(residual[held], cov=covariance)
    found = held_parts.log_density(work, channel, held, residual, columns)
    # White noise on top of a process is one of an order at which the next correlation would be less than a thousandth.
    assert found == pytest.approx(expected, abs=0.02 if decay else 1e-9)


def test_rows_with_long_tails_count_by_students_t(monkeypatch):
    rng, spread = np.random.default_rng(4), np.ones(2)
    work, channel, held, _ = stood_for(monkeypatch, Coloured(0.1), 4.0, spread)
    residual = 0.1 * rng.standard_t(4.0, size=ROWS)
    found = [
        held_parts.log_density(work, channel, held, rows, np.ones((ROWS, 2))) for rows in (residual, 0.5 * residual)
    ]
    expected = [np.sum(student.logpdf(rows[held], 4.0, scale=0.1)) for rows in (residual, 0.5 * residual)]
    # What is given is over the height of the normal density, the same for all predictions.
    assert found[1] - found[0] == pytest.approx(expected[1] - expected[0])
    residual[-1] = 5.0  # an outlier of fifty standard deviations hardly counts, as it would under the normal density
    lost = found[0] - held_parts.log_density(work, channel, held, residual, np.ones((ROWS, 2)))
    assert lost < 0.05 * -norm.logpdf(50.0)
