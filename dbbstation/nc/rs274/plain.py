"""Lines of axes with G0, G1, F and N at most, read many at once: most of what CAM systems write is of this kind."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

LEAST_LINES, MOST_LINES = 4, 20_000
"""Lines that are read at once: fewer are sooner read one by one."""

_NUMBER = r"[+-]?(?:[0-9]{1,6}(?:\.[0-9]{0,12})?|\.[0-9]{1,12})"
"""So long that no line of these is longer than LinuxCNC reads."""

_LINE = (
    r"(?:N([0-9]{1,8}) ?)?(?:G0?([01])(?![0-9.]) ?)?(?=[XYZABC])"
    + "".join(rf"(?:{axis}({_NUMBER})[ ]?)?" for axis in "XYZABC")
    + r"(?:F([0-9]{1,8}(?:\.[0-9]{0,6})?))? ?\r?\n"
)
LINES = re.compile(rf"(?:{_LINE}){{{LEAST_LINES},{MOST_LINES}}}+")
_ONE = re.compile(_LINE)


class PlainLines(NamedTuple):
    """What successive lines say, row by row.

    Attributes:
        numbers: line numbers, of the lines that have one.
        motion: 0 or 1, NaN if not said, shape (n,).
        feed: F, NaN if not said, shape (n,).
        axes: X, Y, Z, A, B, C as written, NaN if not named, shape (n, 6).
    """

    numbers: list[int]
    motion: NDArray[np.float64]
    feed: NDArray[np.float64]
    axes: NDArray[np.float64]


def plain_lines(text: str) -> PlainLines:
    """Return what lines say that `LINES` matches."""
    numbers, *columns = zip(*_ONE.findall(text), strict=True)
    motion, *axes, feed = (np.array([float(one) if one else math.nan for one in each]) for each in columns)
    return PlainLines([int(one) for one in numbers if one], motion, feed, np.column_stack(axes))


def going_on(values: NDArray[np.float64], before: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return modal values, shape (n, k), each NaN as the value above it; `before`, shape (k,), stands above the first."""
    known = np.vstack([before, values])
    at = np.where(np.isnan(known), 0, np.arange(len(known))[:, None])
    filled: NDArray[np.float64] = np.take_along_axis(known, np.maximum.accumulate(at, axis=0), axis=0)[1:]
    return filled
