"""Directions that circles lose: their words, and the parameters that hold them when they are prescribed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from scipy.linalg import qr

from dbbstation.computing.arrays import place_of_largest
from dbbstation.errors import CalibrationError
from dbbstation.inference.triangle import ROUNDING
from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import Owner

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.layout import Layout
    from dbbstation.computing.arrays import Floats


RECOGNISED = 0.02
"""A known pattern counts as lost if at most this share is outside the lost directions."""

ALONE = 1e-6
"""If a parameter's component in a direction is within this of 1, the direction is named after it."""

SHOWS_IN_CIRCLES = 0.1
"""A direction concerns circles if its component outside the drives' parameters is at least this."""


@dataclass(frozen=True, eq=False)
class RigidPattern:
    """A pattern of strut and base-joint errors that circles may not determine."""

    text: str
    strut_mm: Floats
    base_mm: Floats


def patterns(base_joints_mm: Floats, axis_of_strut: Floats) -> list[RigidPattern]:
    """Return known patterns, in order of trial: rigid motions of the base, common strut length, size, joint with strut."""
    none, still = np.zeros(STRUTS), np.zeros((STRUTS, 3))
    axes = list(zip("XYZ", np.eye(3), strict=True))
    own = [f"base joint {i + 1} along its strut together with that strut's length" for i in range(STRUTS)]
    along = [one[:, None] * axis for one, axis in zip(np.eye(STRUTS), axis_of_strut, strict=True)]
    return [
        *(RigidPattern(f"all six base joints together along {x}", none, np.tile(e, (STRUTS, 1))) for x, e in axes),
        *(
            RigidPattern(f"all six base joints turned together about {x}", none, np.cross(e, base_joints_mm))
            for x, e in axes
        ),
        RigidPattern("all six struts together in length", np.ones(STRUTS), still),
        RigidPattern("the base joints' circle in size", none, base_joints_mm * np.array([1.0, 1.0, 0.0])),
        *map(RigidPattern, own, np.eye(STRUTS), along),
    ]


def in_words(layout: Layout, held: Floats) -> tuple[str, ...]:
    """Return one description per held direction."""
    names = [layout.names[column] for column in layout.fitted]
    remaining = _orthonormal(held * layout.known.scale[layout.fitted])
    texts: list[str] = []
    for pattern in patterns(layout.machine.hexapod.base_joints_mm, _strut_axes(layout)):
        vector = _as_columns(pattern, names)
        if vector is None or len(remaining) == 0:
            continue
        outside = vector - remaining.T @ (remaining @ vector)
        if np.linalg.norm(outside) < RECOGNISED * np.linalg.norm(vector):
            texts.append(pattern.text)
            inside = remaining @ vector
            inside /= np.linalg.norm(inside)
            # Remove the described direction and continue with the remaining space.
            remaining = _orthonormal(remaining - np.outer(inside, inside @ remaining))[: len(remaining) - 1]
    texts += [_largest_parts(row, names) for row in remaining]
    return tuple(texts)


def of_circles(layout: Layout, held: Floats) -> Floats:
    """Return directions without their components in drive parameters, shape (g, f); purely electrical directions are dropped."""
    drives = [np.r_[term.columns] for term in layout.terms if term.source.of_currents]
    if not drives or len(held) == 0:
        return held
    _, share, rows = np.linalg.svd(
        np.where(np.isin(layout.fitted, np.concatenate(drives)), 0.0, held), full_matrices=False
    )
    return rows[share > SHOWS_IN_CIRCLES]


def _as_columns(pattern: RigidPattern, names: list[tuple[str, str, str]]) -> Floats | None:
    parts = {"strut-reference-length": pattern.strut_mm, "base-joints": pattern.base_mm.ravel()}
    present = {name for name, _, _ in names}
    if any(np.any(part) and source not in present for source, part in parts.items()):
        return None
    vector = np.zeros(len(names))
    for source, part in parts.items():
        rows = [k for k, (name, _, _) in enumerate(names) if name == source]
        if rows:
            vector[rows] = part
    return vector


def _strut_axes(layout: Layout) -> Floats:
    travel, hexapod = layout.machine.travel, layout.machine.hexapod
    middle = np.array([0.0, 0.0, sum(travel.z_mm) / 2.0])
    struts = hexapod.platform_joints_mm + middle - hexapod.base_joints_mm
    return struts / np.linalg.norm(struts, axis=1, keepdims=True)


def _largest_parts(row: Floats, names: list[tuple[str, str, str]]) -> str:
    largest = np.argsort(-np.abs(row))[:3]
    called = [f"{names[k][0]} {names[k][2].removesuffix('_mm').replace('_', ' ')}" for k in largest]
    if np.abs(row[largest[0]]) > 1.0 - ALONE:
        return called[0]
    parts = [f"{row[k]:+.2f} {name}" for k, name in zip(largest, called, strict=True)]
    return "a combination, mostly " + ", ".join(parts)


def _orthonormal(rows: Floats) -> Floats:
    if len(rows) == 0:
        return rows
    _, s, vt = np.linalg.svd(rows, full_matrices=False)
    return vt[s > 1e-9 * s[0]]


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
    return tuple(fitted[place_of_largest(np.abs(row))] for row in held)


def _fitted(layout: Layout) -> list[Name]:
    names = [
        (term.source.name, parameter.name) if term.source.belongs_to is Owner.MACHINE else ("", "")
        for term in layout.terms
        for parameter in term.parameters
    ]
    return [names[column] for column in layout.fitted]


def _best(fitted: Sequence[Name], lost: Floats) -> list[int]:
    if not len(lost):
        return []
    unseen = np.linalg.norm(lost, axis=0) > 1.0 - ROUNDING
    preferred = [k for k, (source, _) in enumerate(fitted) if source == PREFERRED or unseen[k]]
    candidates = preferred if len(preferred) >= len(lost) else list(range(len(fitted)))
    (_, order) = qr(lost[:, candidates], mode="r", pivoting=True)
    return sorted(candidates[k] for k in order[: len(lost)])
