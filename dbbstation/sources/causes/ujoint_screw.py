"""Universal joints that rotate the screws."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import ModelError
from dbbstation.machine.kinematics import inverse
from dbbstation.machine.travel import middle
from dbbstation.sources.contract import SMOOTH_MM, CForm, Effect, LinearSource, Motion, Owner, Parameter, Texts
from dbbstation.sources.laws.weights import screw_lead_mm

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Frames, JointAxes, Machine
    from dbbstation.machine.kinematics import Struts

ALONG = 0.05
"""Sine of the least angle between a joint's axis and its strut; below it, 3 degrees, the joint is locked [1]."""


class UjointScrew(LinearSource):
    """As joints swing, the two strut parts rotate against each other, and the screw converts rotation to travel.

    A universal joint's second axis is along a x u, with first axis a and strut u. With psi the angle about u between
    both second axes, relative to the untilted middle pose, and lead p, dL = p psi / (2 pi). Ball joints rotate freely.
    """

    name = "ujoint-screw"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    varies_with = "joint-angle"
    form_uncertainty = 0.05  # joint axes are square to a few hundredths
    texts = Texts(
        what="The struts hang in universal joints. As the platform moves, the joints turn nut and screw against each other, "
        "and the strut travels without its motor turning.",
        shows="Circles shifted and deformed, the same in both directions, more as the platform is tilted and turned. It is "
        "large, tenths of a millimetre, where the control does not reckon with it; most controls do.",
        confirm="Block a motor, swing the strut by hand at its lower end and compare its length before and after; or look "
        "in the control's manual whether it corrects the turning of the screws.",
        cure="Enter the axes of the joints in the control, or switch its correction on; otherwise export compensated "
        "programs.",
        equation="actual minus driven length = p (psi - psi of the middle pose) / (2 pi), psi about u from a_b x u to "
        "(R a_p) x u",
        origin="geometry of a universal (Hooke's) joint: its second axis lies across the first and across the strut",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        _axes(machine)
        meaning = "travel per turn of the platform end about the strut, seen along it clockwise; 0 where corrected"
        return (Parameter("lead_mm", "mm", screw_lead_mm(self.name, machine), meaning),)

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        axes = _axes(machine)
        here = _second_axes(axes, motion.struts(machine), motion.frames(machine))
        at_rest = middle(machine)
        rest = _second_axes(axes, inverse(machine.hexapod, at_rest), at_rest)
        # Products of unit complex numbers give angle differences without jumps of a turn.
        turned = np.angle(here * rest.conj())
        return Effect(strut_mm=(turned / (2.0 * np.pi))[:, :, None])

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        axes, at_rest = _axes(machine), middle(machine)
        rest = _second_axes(axes, inverse(machine.hexapod, at_rest), at_rest)[0]
        return CForm(
            """EACH {
    double a[3], b[3], of_base[3], of_platform[3], both[3];
    turned(at->r, platform[i], a);
    cross(base[i], at->unit[i], of_base), cross(a, at->unit[i], of_platform), cross(of_base, of_platform, both);
    b[0] = dot(of_base, of_platform), b[1] = dot(at->unit[i], both);
    e->strut[i] += v[0] / 6.28318530717958647693 * atan2(b[1] * rest[i][0] - b[0] * rest[i][1], b[0] * rest[i][0] + b[1] * rest[i][1]);
}""",
            constants={
                "base": axes.base / _length(axes.base),
                "platform": axes.platform / _length(axes.platform),
                "rest": np.column_stack([rest.real, rest.imag]),
            },
        )


def _second_axes(axes: JointAxes, struts: Struts, frames: Frames) -> NDArray[np.complex128]:
    """Return psi of each strut as a unit complex number, shape (n, 6)."""
    unit = struts.unit
    platform = np.einsum("nij,kj->nki", frames.rotation, axes.platform / _length(axes.platform))
    base = np.broadcast_to(axes.base / _length(axes.base), unit.shape)
    of_base, of_platform = np.cross(base, unit), np.cross(platform, unit)
    across = np.stack([_length(of_base)[..., 0], _length(of_platform)[..., 0]])
    if across.min() < ALONG:
        end, pose, strut = np.unravel_index(int(across.argmin()), across.shape)
        raise ModelError(
            f"the axis of the {('base', 'platform')[end]} joint of strut {strut + 1} lies along the strut at pose "
            f"{pose + 1}, where the joint cannot swing",
            remedy="check `joint_axes` in the machine file",
        )
    sine = np.einsum("nki,nki->nk", unit, np.cross(of_base, of_platform))
    cosine = np.einsum("nki,nki->nk", of_base, of_platform)
    found: NDArray[np.complex128] = (cosine + 1j * sine) / np.hypot(cosine, sine)
    return found


def _length(vectors: Floats) -> Floats:
    return np.asarray(np.linalg.norm(vectors, axis=-1, keepdims=True))


def _axes(machine: Machine) -> JointAxes:
    if machine.joint_axes is None:
        raise ModelError(
            f"the error source {UjointScrew.name} needs the directions of the universal joints' axes, and the machine "
            f"{machine.name!r} has no `joint_axes`",
            remedy="add `joint_axes: {base: ..., platform: ...}` to the machine file, six unit vectors each, or leave "
            "this source out",
        )
    return machine.joint_axes
