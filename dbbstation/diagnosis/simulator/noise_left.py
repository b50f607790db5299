"""Noise and probability of a refit."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.table.data import rounding_of
from dbbstation.inference.bank import Bank
from dbbstation.inference.channel import Base, Channel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.simulator.work import SimulationRuns
    from dbbstation.inference.channel import Law


def channel_of(work: SimulationRuns, residual: Floats, base: Base, laws: Sequence[Law] = ()) -> Channel:
    """Return the channel of all rows of a simulator's recordings."""
    outputs = work.model.outputs
    return Channel(
        residual=residual,
        unit=outputs[0].unit,
        blocks=tuple(work.blocks),
        names=tuple(f"{run.name}, {output.name}" for run in work.model.runs for output in outputs),
        variables=(),
        base=base,
        laws=tuple(laws),
        time=work.time,
        static=(),
        least_noise=min(rounding_of(work.measured[rows]) / work.scale[rows.start] for rows in work.blocks),
        levels=work.output if len(outputs) > 1 else None,
    )


def noise_left(
    work: SimulationRuns,
    residual: Floats,
    columns: Floats,
    off: Floats | None = None,
    rows: Channel | None = None,
) -> Bank:
    """Estimate a refit's noise, accounting for all fitted columns.

    Args:
        off: slack of unit size, shape (n, q); or None.
        rows: channel of kept rows; None for all.
    """
    off = np.zeros((len(residual), 0)) if off is None else off
    fitted, free = columns.shape[1], off.shape[1]
    base = Base(
        tuple(str(k) for k in range(fitted + free)),
        np.hstack([columns, off]),
        np.concatenate([np.full(fitted, np.inf), np.ones(free)]),
        np.arange(fitted + free) >= fitted,
    )
    channel = channel_of(work, residual, base)
    if rows is not None:
        channel = replace(channel, kept=rows.kept, apart=rows.apart)
    bank = Bank(channel)
    bank.measures_beside_members = True
    bank.measure(())
    return bank


def log_probability_of(bank: Bank, residual: Floats, off: Floats, numbers: int) -> float:
    """Return the log probability of rows with cost of parameters [Schwarz's criterion], up to a constant.

    Args:
        off: slack of unit size, marginalised, shape (n, q).
    """
    rows = bank.whitened(residual) / bank.noise.innovation
    beside = bank.whitened(off) / bank.noise.innovation
    products = np.eye(beside.shape[1]) + beside.T @ beside
    towards = beside.T @ rows
    squares = float(rows @ rows - towards @ np.linalg.solve(products, towards))
    spread = float(np.linalg.slogdet(products)[1])
    return bank.log_level() - 0.5 * (squares + spread + numbers * float(np.log(len(rows))))
