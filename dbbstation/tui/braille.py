"""Draw planes of dots as braille characters, two by four dots a cell.

A plane is a boolean array, shape (4 rows, 2 columns), y downwards. Overlaid planes share cells, which are coloured by
plane.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Flags, Floats

    Plane: TypeAlias = Flags

CELL_WIDE, CELL_HIGH = 2, 4
"""Number of dots in a cell."""

BLANK = 0x2800
"""Code point of the braille character without dots; its lowest eight bits stand for the raised dots."""

_BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], dtype=np.uint8)
"""Bit of each dot in a cell: three rows in the order of six-dot braille, the fourth was added below [Unicode, U+2800]."""


def empty(columns: int, rows: int) -> Plane:
    """Return a plane without dots."""
    return np.zeros((rows * CELL_HIGH, columns * CELL_WIDE), dtype=np.bool_)


def light(plane: Plane, x: Floats, y: Floats) -> None:
    """Raise dots at points inside the plane."""
    with np.errstate(invalid="ignore"):
        inside = (x >= 0.0) & (x < plane.shape[1]) & (y >= 0.0) & (y < plane.shape[0])
    plane[y[inside].astype(np.intp), x[inside].astype(np.intp)] = True


def connect(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Return the points with further points in between, so that lines have no gaps.

    NaN separates lines.
    """
    if len(x) < 2:  # noqa: PLR2004 - a line has two ends
        return x, y
    step_x, step_y = np.diff(x), np.diff(y)
    steps = np.ceil(np.maximum(np.abs(step_x), np.abs(step_y)))
    more = np.where(np.isfinite(steps), np.maximum(steps - 1.0, 0.0), 0.0).astype(np.intp)
    segment = np.repeat(np.arange(len(more)), more)
    # Counts 1, 2, … up to `more` within each segment.
    place = np.arange(len(segment)) - np.repeat(np.cumsum(more) - more, more) + 1
    share = place / (more[segment] + 1)
    return (
        np.concatenate([x, x[segment] + share * step_x[segment]]),
        np.concatenate([y, y[segment] + share * step_y[segment]]),
    )


def patterns(plane: Plane) -> NDArray[np.uint8]:
    """Return the dots of every cell as its character's lowest byte, shape (rows, columns)."""
    high, wide = plane.shape
    cells = plane.reshape(high // CELL_HIGH, CELL_HIGH, wide // CELL_WIDE, CELL_WIDE)
    return np.einsum("rycx,yx->rc", cells, _BITS, dtype=np.uint8)


def overlay(planes: Sequence[Plane]) -> tuple[NDArray[np.uint32], NDArray[np.uint8]]:
    """Return the code points of overlaid planes, and for each cell one bit per plane with dots, the lowest for the first plane; shape (rows, columns)."""
    codes = np.zeros((planes[0].shape[0] // CELL_HIGH, planes[0].shape[1] // CELL_WIDE), dtype=np.uint32)
    members = np.zeros(codes.shape, dtype=np.uint8)
    for number, plane in enumerate(planes):
        dots = patterns(plane)
        codes |= dots
        members |= (dots > 0).astype(np.uint8) << np.uint8(number)
    # A space where there is nothing: some fonts draw the empty braille character as eight faint rings.
    return np.where(codes > 0, codes + BLANK, ord(" ")).astype(np.uint32), members
