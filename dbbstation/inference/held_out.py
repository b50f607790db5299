"""Predict omitted blocks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.blocks import Block, Columns, spread
from dbbstation.inference.square_root import Solution, solve

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats, Integers


@dataclass(frozen=True)
class HeldOut:
    """Prediction errors of omitted measurements.

    Attributes:
        rms: with the omitted blocks' random effects fitted under priors, in the channel's unit.
        normalised: root of chi-square by predicted covariance per degree of freedom; near 1 if correct.
    """

    rms: float
    normalised: float


def held_out(
    blocks: Sequence[Block],
    groups: Sequence[int],
    known: Columns,
    active: Integers,
    base: int,
    noise: float,
    held: Floats,
    single: float | None = None,
) -> HeldOut:
    """Omit groups of blocks in turn and predict them.

    Args:
        groups: group of each block, such as the fold of its test.
        active: columns that predict, all of the base first.
        base: number of the base's columns. The kept blocks alone give the others, which are causes.
        noise: white noise of equal low-frequency power.
        held: directions of the base's fitted columns held at zero, in scaled columns.
        single: noise of a single measurement, if smaller than `noise`; else None.
    """
    used = Columns(known.prior[active], known.scale[active], known.random[active] & (active < base))
    held = np.hstack([held, np.zeros((len(held), len(active) - base))])
    thin = [_restricted(block, active) for block in blocks]
    square, count, weighted, rows = 0.0, 0, 0.0, 0
    for group in sorted(set(groups)):
        kept = [b for b, g in zip(thin, groups, strict=True) if g != group]
        out = [b for b, g in zip(thin, groups, strict=True) if g == group]
        fitted = solve(kept, used, noise, held)
        square += _left(out, used, fitted.x, noise)
        count += sum(block.count for block in out)
        inside, degrees = _weighted(out, fitted, noise if single is None else single)
        weighted += inside
        rows += degrees
    return HeldOut(float(np.sqrt(square / count)), float(np.sqrt(weighted / max(rows, 1))))


def _restricted(block: Block, active: Integers) -> Block:
    place = {int(column): k for k, column in enumerate(active)}
    inside = np.array([int(column) in place for column in block.columns], dtype=bool)
    columns = np.array([place[int(c)] for c in block.columns[inside]], dtype=np.int64)
    return Block(columns, block.triangle[:, inside], block.target, block.count, block.square)


def _weighted(blocks: Sequence[Block], fitted: Solution, noise: float) -> tuple[float, int]:
    # The last row of a triangular factor contains the norm outside all columns, not the noise of one measurement.
    cut = [Block(b.columns, b.triangle[:-1], b.target[:-1], b.count, b.square) for b in blocks]
    whole, target = np.hsplit(spread(cut, len(fitted.x)), [-1])
    remaining = (target[:, 0] - whole @ fitted.x) / noise
    variance, axes = np.linalg.eigh(fitted.covariance)
    uncertain = whole @ (axes * np.sqrt(np.maximum(variance, 0.0))) / noise
    towards = uncertain.T @ remaining
    explained = towards @ np.linalg.solve(np.eye(len(towards)) + uncertain.T @ uncertain, towards)
    return float(remaining @ remaining - explained), len(remaining)


def _left(blocks: Sequence[Block], known: Columns, x: Floats, noise: float) -> float:
    random = np.flatnonzero(known.random)
    whole, target = np.hsplit(spread(blocks, len(known.prior)), [-1])
    fixed = x.copy()
    fixed[random] = 0.0
    remaining = target[:, 0] - whole @ fixed
    stacked = np.vstack([whole[:, random] / noise, np.diag(1.0 / known.prior[random])])
    effects, *_ = np.linalg.lstsq(stacked, np.concatenate([remaining / noise, np.zeros(len(random))]), rcond=None)
    remaining = remaining - whole[:, random] @ effects
    # The targets' part outside all columns remains in every fit.
    beyond = sum(block.square - float(block.target @ block.target) for block in blocks)
    return float(remaining @ remaining) + max(beyond, 0.0)
