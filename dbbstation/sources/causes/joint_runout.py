"""Joints whose axes do not meet in a point."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUTS
from dbbstation.machine.kinematics import inverse
from dbbstation.machine.travel import middle
from dbbstation.sources.contract import (
    MM_PER_UM,
    SMOOTH_MM,
    CForm,
    Effect,
    LinearSource,
    Motion,
    Owner,
    Parameter,
    Texts,
    of_own_strut,
)

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

WAYS = ("upward", "sideways", "skew")
ENDS = ("base", "platform")

USUAL_UM = 20.0


class JointRunout(LinearSource):
    """If a joint's axes do not meet, or its ball is not round, the strut's length changes as the joint swings.

    The second axis of a universal joint passes the first at the distance e, towards the strut. The controller assumes
    the strut's end on the first axis. For a swing beta about the second axis, dL = e (cos(beta) - 1), about -e/2
    sin²(beta), with sin(beta) = u a, strut direction u and first axis a. An offset fixed in the strut is a length
    error.

    The axes' directions need not be known. d is the strut's direction in base or platform minus its direction at
    mid-travel. Its components along v (in the strut's vertical plane) and h (level), both perpendicular to the strut
    there, give:

    dL = -1/2 (e_vv d_v² + e_hh d_h² + 2 e_vh d_v d_h).

    To second order this holds for a universal joint whose first axis a is perpendicular to the strut there (e_vv = e
    a_v² and so on). It also holds for an oval ball, whose radius is a quadratic form of the direction. Each of twelve
    joints has three numbers.

    If the strut's end is offset transversely and rotates about the first axis like a crank, dL = f_v d_v + f_h d_h,
    like a displaced joint. In the base, the source `base-joints` covers this effect. In the platform it needs two more
    numbers per strut, which tests hardly separate from `platform-joints`.
    """

    name = "joint-runout"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    varies_with = "joint-angle"
    form_uncertainty = 0.2  # a joint out of true has more than one harmonic
    texts = Texts(
        what="A joint is not a point: the two axes of a universal joint do not meet, or the ball of a ball joint is oval.",
        shows="Circles shifted and deformed by a few micrometres, the same in both directions, growing with the square "
        "of the swing of the joint: with the tilt for platform joints, with the way off the middle for base joints.",
        confirm="Take the strut off at its other end, put a dial gauge on the joint's housing towards the strut and "
        "swing the strut about one axis of the joint, then about the other.",
        cure="Exchange or shim the joint.",
        equation="actual minus driven length = -1/2 (e_vv d_v² + e_hh d_h² + 2 e_vh d_v d_h) for each joint, and f_v d_v + "
        "f_h d_h for that of the platform, d the strut's direction less that in the middle of the travel",
        origin="geometry of a universal (Hooke's) joint with offset axes, e (cos(beta) - 1), to second order in the swing",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        swings = dict(zip(WAYS, ("up and down", "sideways", "both ways at once"), strict=True))
        towards = "offset of the axes of its {} joint, as the strut swings {}; positive: towards the strut"
        across = "offset of the strut's end across it, which goes round the first axis of its platform joint: {} part"
        found: list[Parameter] = []
        for i in range(STRUTS):
            of = f"strut_{i + 1}"
            for end in ENDS:
                found += [
                    Parameter(f"{of}_{end}_{way}_um", "µm", USUAL_UM, towards.format(end, swings[way]), strut=i + 1)
                    for way in WAYS
                ]
            found += [
                Parameter(f"{of}_platform_across_{way}_um", "µm", USUAL_UM, across.format(way), strut=i + 1)
                for way in WAYS[:2]
            ]
        return tuple(found)

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        lengths = motion.once(self.name, machine, lambda: _per_offset(motion, machine))
        return Effect(strut_mm=MM_PER_UM * np.einsum("nkp,kp->nk", lengths, values.reshape(STRUTS, -1)))

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        lengths = motion.once(self.name, machine, lambda: _per_offset(motion, machine))
        return Effect(strut_mm=of_own_strut(MM_PER_UM * lengths))

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        rest = inverse(machine.hexapod, middle(machine)).unit[0]
        return CForm(
            """EACH {
    double seen[3], swing[2][2];
    turned_back(at->r, at->unit[i], seen);
    for (int k = 0; k < 3; k++) seen[k] -= rest[i][k];
    for (int a = 0; a < 2; a++) {
        swing[0][a] = dot(at->unit[i], across[i][a]) - dot(rest[i], across[i][a]);
        swing[1][a] = dot(seen, across[i][a]);
    }
    const double *own = v + 8 * i;
    for (int end = 0; end < 2; end++) {
        double up = swing[end][0], level = swing[end][1];
        const double *o = own + 3 * end;
        e->strut[i] -= 1e-3 * (o[0] * up * up / 2.0 + o[1] * level * level / 2.0 + o[2] * up * level);
    }
    e->strut[i] += 1e-3 * dot((double[3]){own[6], own[7], 0.0}, (double[3]){swing[1][0], swing[1][1], 0.0});
}""",
            constants={"rest": rest, "across": _across(rest)},
        )


def _per_offset(motion: Motion, machine: Machine) -> Floats:
    """Return each strut's length change per offset of its joints, in parameter order, shape (n, 6, 8) [1]."""
    frames = motion.frames(machine)
    unit, rest = motion.struts(machine).unit, inverse(machine.hexapod, middle(machine)).unit[0]
    across = _across(rest)
    in_platform = np.einsum("nji,nkj->nki", frames.rotation, unit)
    swings = [np.einsum("nki,kai->nka", seen - rest, across) for seen in (unit, in_platform)]
    return np.concatenate([*(-_forms(swing) for swing in swings), swings[1]], axis=2)


def _across(rest: Floats) -> Floats:
    """Return directions v and h perpendicular to `rest`, shape (6, 3); shape (6, 2, 3) [1]."""
    level = np.cross(rest, [0.0, 0.0, 1.0])
    size = np.linalg.norm(level, axis=1, keepdims=True)
    # For a vertical strut the vertical plane is undefined: use the plane of X.
    level = np.where(size > 1e-9, level / np.maximum(size, 1e-9), [0.0, -1.0, 0.0])  # noqa: PLR2004
    return np.stack([np.cross(level, rest), level], axis=1)


def _forms(swing: Floats) -> Floats:
    """Return v²/2, h²/2 and v h of swings (v, h), shape (n, 6, 2); shape (n, 6, 3) [1]."""
    v, h = swing[..., 0], swing[..., 1]
    return np.stack([v**2 / 2.0, h**2 / 2.0, v * h], axis=-1)
