"""Parameters held at nominal instead of lost directions, as in the standard circular test [CAL III-A-2].

The standard test loses six directions. Any six prescribed parameters define coordinates, and with them the machine's
place in space; all choices fit the circles equally.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from scipy.linalg import qr

from dbbstation.errors import CalibrationError
from dbbstation.inference.square_root import ROUNDING
from dbbstation.sources.contract import Owner

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.layout import Layout
    from dbbstation.computing.arrays import Floats

Name: TypeAlias = tuple[str, str]
"""A parameter, by source and name."""

PREFERRED = "base-joints"
"""Source of the parameters that are prescribed by default: base joints define coordinates like a 3-2-1 location."""

LEAST_SHARE = 1e-3
"""Least part of a lost direction that the prescribed parameters must fix."""


def prescribed(layout: Layout, lost: Floats, wanted: Sequence[Name]) -> Floats:
    """Return rows that hold parameters instead of lost directions.

    Args:
        lost: orthonormal rows in scaled parameters, shape (h, f).
        wanted: parameters, as many as lost directions; empty to choose the best base-joint coordinates.

    Raises:
        CalibrationError: wrong number, a parameter that is not fitted, or a lost direction that stays free.
    """
    fitted = _fitted(layout)
    if not wanted:
        rows = _best(fitted, lost)
    else:
        unknown = [f"{source}.{name}" for source, name in wanted if (source, name) not in fitted]
        if unknown:
            raise CalibrationError(
                f"{', '.join(unknown)} cannot be prescribed: these parameters are not fitted",
                remedy=f"name them as in {'.'.join(fitted[0])}",
            )
        if len(set(wanted)) != len(lost):
            raise CalibrationError(
                f"{len(set(wanted))} parameters are prescribed, but these tests leave {len(lost)} directions undetermined",
                remedy=f"prescribe {len(lost)}, or leave the choice to the program",
            )
        rows = [fitted.index(name) for name in dict.fromkeys(wanted)]
    if rows and np.linalg.svd(lost[:, rows], compute_uv=False)[-1] < LEAST_SHARE:
        raise CalibrationError(
            f"the parameters {', '.join('.'.join(fitted[row]) for row in rows)} do not hold every direction that these tests leave undetermined",
            remedy="prescribe, for example, all three coordinates of one base joint, two of another, one of a third",
        )
    return np.eye(len(fitted))[rows]


def names_of(layout: Layout, held: Floats) -> tuple[Name, ...]:
    """Return parameters that unit rows, shape (h, f), hold."""
    fitted = _fitted(layout)
    return tuple(fitted[int(np.argmax(np.abs(row)))] for row in held)


def _fitted(layout: Layout) -> list[Name]:
    names = [
        (term.source.name, parameter.name) if term.source.belongs_to is Owner.MACHINE else ("", "")
        for term in layout.terms
        for parameter in term.parameters
    ]
    return [names[column] for column in np.flatnonzero(~layout.known.random)]


def _best(fitted: Sequence[Name], lost: Floats) -> list[int]:
    if not len(lost):
        return []
    unseen = np.linalg.norm(lost, axis=0) > 1.0 - ROUNDING
    preferred = [k for k, (source, _) in enumerate(fitted) if source == PREFERRED or unseen[k]]
    candidates = preferred if len(preferred) >= len(lost) else list(range(len(fitted)))
    (_, order) = qr(lost[:, candidates], mode="r", pivoting=True)
    return sorted(candidates[k] for k in order[: len(lost)])
