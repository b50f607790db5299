"""Predictive density of held-out rows after a refit, with correlated noise and parameter uncertainty."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.noise_left import noise_left
from dbbstation.inference.uneven import log_student

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.diagnosis.simulator.work import SimulationRuns
    from dbbstation.inference.channel import Channel


def log_density(
    work: SimulationRuns,
    channel: Channel,
    rows: Flags,
    residual: Floats,
    columns: Floats,
) -> float:
    """Return the log density of rows for a refit to other rows [Good 1952]; Student's t for long tails.

    Args:
        rows: predicted rows, shape (n,).
        columns: derivatives by fitted parameters, shape (n, m).
    """
    bank = noise_left(work, residual, columns, rows=channel)
    noise, kinds = bank.noise, work.output[channel.kept]
    sizes = np.array([float(np.mean(bank.spread[kinds == k])) for k in range(len(work.model.outputs))])
    spread = sizes[work.output[rows]]
    whitening = noise.whitening(replace(channel, kept=rows, apart=1).stretches)

    def white(values: Floats) -> Floats:
        even = (values[rows].T / spread).T
        return (even if whitening is None else whitening @ even) / noise.innovation

    level = 0.0 if whitening is None else float(np.log(whitening.diagonal()).sum())
    level -= float(np.log(np.sqrt(2.0 * np.pi) * noise.innovation * spread).sum())
    left = white(residual)
    if np.isfinite(bank.tails):
        return level + float(np.sum(log_student(left, bank.tails)))
    own = bank.whitened(columns) / noise.innovation
    open_, norm = work.model.inverse_information(own, 1e-10)
    there = white(columns) / norm
    # The rows' covariance is one plus there @ open_ @ there.T; Woodbury's formula gives inverse and determinant.
    inner = np.eye(len(open_)) + open_ @ (there.T @ there)
    towards = there.T @ left
    squares = float(left @ left - towards @ np.linalg.solve(inner, open_ @ towards))
    return level - 0.5 * (squares + float(np.linalg.slogdet(inner)[1]))
