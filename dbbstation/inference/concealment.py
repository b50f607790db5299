"""The share of a signature that fitted parameters absorb."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.blocks import spread
from dbbstation.inference.triangle import axes_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.inference.blocks import Block

SEEN = 1e-5
"""Relative singular value of fitted columns below which a direction is not identifiable and takes up nothing."""


@dataclass(frozen=True)
class Concealment:
    """A signature before and after absorption.

    Attributes:
        share: of squares, 1 - |rest|²/|whole|².
    """

    share: float
    whole_rms: float
    rest_rms: float


def concealment(
    blocks: Sequence[Block],
    fitted: NDArray[np.int64],
    columns: NDArray[np.int64],
    amplitudes: NDArray[np.float64],
    free: NDArray[np.float64] | None = None,
) -> Concealment:
    """Return the absorbed share over all samples, unweighted.

    Args:
        fitted: columns, shape (f,).
        free: fitted directions as columns, shape (f, g); None: all. Held directions absorb nothing.
    """
    wanted = np.concatenate([fitted, columns])
    size = 1 + max(int(wanted.max()), *(int(block.columns.max()) for block in blocks))
    stacked = spread(blocks, size)[:, wanted]
    explaining, signature = stacked[:, : len(fitted)], stacked[:, len(fitted) :] @ amplitudes
    explaining = explaining if free is None else explaining @ free
    axes = axes_of(explaining, SEEN)
    rest = signature - axes @ (axes.T @ signature)
    count = sum(block.count for block in blocks)
    whole2, rest2 = float(signature @ signature), float(rest @ rest)
    share = 1.0 - rest2 / whole2 if whole2 > 0.0 else 0.0
    return Concealment(share, float(np.sqrt(whole2 / count)), float(np.sqrt(rest2 / count)))
