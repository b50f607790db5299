"""The arc of a block, from its centre or radius, and its curve, from control points."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.nc.rs274.arcs import CHORD_ERROR_MM, Arc, centre_by_radius
from dbbstation.nc.rs274.codes import ModalGroup, name
from dbbstation.nc.toolpath import PLANES

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.nc.rs274.blocks import ProgramBlock
    from dbbstation.nc.rs274.state import ControlState

CENTRES = "IJK"


def arc_of(
    block: ProgramBlock,
    state: ControlState,
    target: Floats,
    *,
    clockwise: bool,
    plane: int,
    absolute: bool,
) -> Arc:
    """Return the arc from the control's pose, and remove its words from the block.

    Args:
        absolute: whether the centre counts from the origin (G90.1).

    Raises:
        BadLine: no such arc.
    """
    column, axes, code = block.first_column, PLANES[plane], "G2" if clockwise else "G3"
    radius = block.words.pop("R", None)
    offsets = [block.words.pop(CENTRES[axis], None) for axis in axes]
    other = block.words.get(CENTRES[3 - int(axes.sum())])
    if other is not None and other.value == 0.0 and not absolute:
        del block.words[other.letter]  # as some posts write: the centre lies in the plane
    turns, start = _turns(block), state.pose
    if radius is not None:
        if any(offsets):
            raise block.fault("an arc has R, or I, J and K, not both", "remove one", radius)
        by_radius = centre_by_radius(start[axes], target[axes], radius.value * state.unit_mm, clockwise=clockwise)
        if by_radius is None:
            what = f"no arc of R{radius.value:g} leads from the point before to this one"
            raise block.fault(what, "check R, or write a full turn with its centre", radius)
        return Arc(start, target, by_radius, clockwise=clockwise, turns=turns, plane=plane)
    if not any(offsets):
        letters = " and ".join(CENTRES[axis] for axis in sorted(axes))
        raise block.fault(f"{code} needs {letters}, or R", "give the centre", column)
    centre = np.array([0.0 if word is None else word.value * state.unit_mm for word in offsets])
    if not absolute:
        centre += start[axes]
    elif not all(offsets):
        letters = " and ".join(CENTRES[axis] for axis in sorted(axes))
        raise block.fault(f"G90.1 needs both {letters}", "give both, or G91.1", column)
    else:
        centre += np.array(state.offset)[axes]
    arc = Arc(start, target, (float(centre[0]), float(centre[1])), clockwise=clockwise, turns=turns, plane=plane)
    if not arc.is_round(state.unit_mm):
        first, last = arc.radii_mm()
        what = f"start and end of the arc lie {first:.4f} and {last:.4f} mm from its centre"
        raise block.fault(what, "check end point and centre", column)
    return arc


def curve_of(block: ProgramBlock, state: ControlState, target: Floats) -> Floats:
    """Return points of a Bézier curve in X and Y whose chords keep `CHORD_ERROR_MM`, shape (k, 6), and remove its words.

    G5.1 is quadratic: I and J lead from the begin to the control point. G5 is cubic: P and Q lead from the end to the
    second control point [LinuxCNC, G5 Cubic Spline and G5.1 Quadratic Spline].

    Raises:
        BadLine: no such curve.
    """
    code = block.codes[ModalGroup.SMOOTHING]
    letters = "IJPQ" if code.value == 5.0 else "IJ"  # noqa: PLR2004
    words = [word.value for letter in letters if (word := block.words.pop(letter, None)) is not None]
    if len(words) < len(letters):
        what = f"{name('G', code.value)} needs {', '.join(letters)}"
        raise block.fault(what, "give the control points", code)
    offsets = np.array(words).reshape(-1, 2) * state.unit_mm
    begin, end = state.pose[:2], target[:2]
    points = np.array([begin, begin + offsets[0], *(end + offsets[1:]), end])[:, None]
    degree = len(points) - 1
    # A chord leaves the curve by at most an eighth of its second derivative.
    second = degree * (degree - 1) * float(np.linalg.norm(np.diff(points, 2, axis=0), axis=-1).max())
    count = max(1, math.ceil(math.sqrt(second / 8.0 / CHORD_ERROR_MM)))
    share = np.arange(1, count + 1)[:, None] / count
    while len(points) > 1:
        points = (1.0 - share) * points[:-1] + share * points[1:]
    poses = np.tile(target, (count, 1))
    poses[:-1, :2] = points[0, :-1]
    return poses


def _turns(block: ProgramBlock) -> int:
    word = block.words.pop("P", None)
    if word is None:
        return 1
    if not word.counts(1.0):
        raise block.fault(f"P{word.value:g} is not a number of turns", "give a whole number from 1", word)
    return int(word.value)
