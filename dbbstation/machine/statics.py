"""Statics of the hexapod: what gravity pulls at, and the force that every strut carries for it.

Conventions: forces [N] and moments about the tool tip [N mm] in machine axes, Z up; a strut's unit vector points from
base to platform, and a tension is positive. With it strut i pulls the platform by -T_i u_i, so that equilibrium of the
platform under a load (F, M) reads sum T_i u_i = F and sum T_i (R P_i) x u_i = M, that is J^T T = [F, M] with the
Jacobian J = [u, (R P) x u] of the strut lengths.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import KinematicsError
from dbbstation.machine import kernels
from dbbstation.machine.compiled import in_blocks
from dbbstation.machine.geometry import STRUTS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Compliance, Masses, StrutMasses
    from dbbstation.machine.kinematics import Struts
    from dbbstation.machine.rotation import Frames

GRAVITY_M_S2 = 9.81
"""Acceleration of gravity; it differs by up to 0.3 % between places on Earth [m/s²]."""

DOWN = np.array([0.0, 0.0, -1.0])
"""Direction of gravity in the machine frame [1]."""


@dataclass(frozen=True)
class Load:
    """What acts on the platform beside its struts' axial forces.

    Attributes:
        force_n: machine axes, shape (n, 3) [N].
        moment_n_mm: about the tool tip, machine axes, shape (n, 3) [N mm].
    """

    force_n: NDArray[np.float64]
    moment_n_mm: NDArray[np.float64]

    def __add__(self, other: Load) -> Load:
        return Load(self.force_n + other.force_n, self.moment_n_mm + other.moment_n_mm)


def platform_weight(frames: Frames, masses: Masses) -> Load:
    """Weight of the platform, acting at its centre of gravity: [W, r_G x W], W = m g.

    The mass is the platform's own. [GRAV eq 1] takes that of the entire system, which would let the platform carry
    the struts and motors that the base joints carry.
    """
    weight = masses.platform_kg * GRAVITY_M_S2 * DOWN
    lever = frames.rotation[:, :, 2] * masses.centre_of_gravity_above_tip_mm
    return Load(np.broadcast_to(weight, lever.shape), np.cross(lever, weight))


def transverse_pull(struts: Struts, masses: StrutMasses) -> NDArray[np.float64]:
    """Force by which each strut's own weight pulls the platform across the strut, shape (n, 6, 3) [N].

    A strut is a rod that turns about its base joint. Moments about that joint: masses m_k at the distances s_k along
    u weigh sum m_k s_k (u x g), and the platform joint at L answers with a force across the strut. The reaction on
    the platform is f = sum m_k s_k / L * g_across with g_across = g - u (u g). [GRAV eq 2] prints the platform's
    force on the strut instead, of the opposite sign.
    """
    across = GRAVITY_M_S2 * (DOWN - struts.unit * (struts.unit @ DOWN)[:, :, None])
    pull: NDArray[np.float64] = (_first_moment_kg_mm(struts, masses) / struts.length_mm)[:, :, None] * across
    return pull


def _first_moment_kg_mm(struts: Struts, masses: StrutMasses) -> NDArray[np.float64]:
    """First moment of a strut's masses about its base joint, along the strut, shape (n, 6) [kg mm].

    The even rod has its centre at L/2, the motor at half its length behind the joint, the screw half its length
    before its end at the platform joint.
    """
    length = struts.length_mm
    return (
        masses.strut_kg * length / 2.0
        - masses.motor_kg * masses.motor_length_mm / 2.0
        + masses.screw_kg * (length - masses.screw_length_mm / 2.0)
    )


def transverse_load(struts: Struts, pull_n: NDArray[np.float64]) -> Load:
    """Forces that the struts put on the platform across their axes: [sum f, sum (R P) x f].

    [GRAV eq 3 and 6] have the moment; [GRAV eq 1] leaves the force out, which belongs there as well.

    Args:
        pull_n: forces on the platform at its joints, shape (n, 6, 3) [N].
    """
    return Load(pull_n.sum(axis=1), np.cross(struts.arm_mm, pull_n).sum(axis=1))


def strut_tensions(struts: Struts, load: Load) -> NDArray[np.float64]:
    """Axial forces of the struts at their platform joints, tension positive, shape (n, 6) [N].

    Solves J^T T = [F, M] for each pose: [GRAV eq 1 and 6] with the force signed, where eq 7 prints its magnitude.

    Args:
        load: on the platform, one row per pose.

    Raises:
        KinematicsError: a pose where the struts cannot hold the platform.
    """
    count = len(struts.length_mm)
    tension = np.empty((count, STRUTS))
    outcome = np.empty(count, dtype=np.int64)
    force, moment = np.ascontiguousarray(load.force_n), np.ascontiguousarray(load.moment_n_mm)

    def block(start: int, stop: int) -> None:
        kernels.adjoint(start, stop, struts.unit, struts.arm_mm, force, moment, tension, outcome)

    in_blocks(block, count)
    if (outcome != kernels.CONVERGED).any():
        raise KinematicsError(
            "the struts cannot hold the platform there (singular pose)",
            where=f"pose {int(np.argmax(outcome != kernels.CONVERGED)) + 1}",
            remedy="check the machine file's joints and the commanded pose",
        )
    return tension


def compliance_mm_per_n(
    length_mm: NDArray[np.float64], compliance: Compliance
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Elongation per force of struts: the part that does not grow with length, and the part that does.

    [GRAV eq 7] K (alpha L + C_B), written by the compliance c at 1000 mm and the share s of it that grows:
    c (1 - s) and c s L / 1000 mm. (The alpha printed there, S/E, is meant as 1/(S E): a compliance per length.)

    Args:
        length_mm: between the joints, shape (n, 6) [mm].
        compliance: at 1000 mm, and how it divides.

    Returns:
        Fixed part and growing part, each of shape (n, 6) [mm/N]; their sum is the strut's compliance.
    """
    at_1000mm, share = compliance.at_1000mm_mm_per_n, compliance.growing_share
    return np.full(length_mm.shape, at_1000mm * (1.0 - share)), at_1000mm * share * length_mm / 1000.0


def stretch_mm(
    struts: Struts, compliance: Compliance, tension_n: NDArray[np.float64], masses: StrutMasses | None = None
) -> NDArray[np.float64]:
    """Elastic elongation of the struts, shape (n, 6) [mm] [GRAV eq 7].

    With masses the strut's own weight along its axis is in it, which [GRAV eq 7] leaves out: what hangs on the strut
    below a section stretches that section. The fixed part of the compliance is the drive's, which holds what
    `motor_loads` has; along the growing part an even rod counts half, and a screw of length l, of which L hangs below
    the joint, L / (2 l) of its weight. The motor behind the joint stretches nothing.

    Args:
        tension_n: at the platform joints, shape (n, 6) [N].
        masses: of every strut; None for struts without weight.
    """
    fixed, growing = compliance_mm_per_n(struts.length_mm, compliance)
    stretch = (fixed + growing) * tension_n
    if masses is None:
        return stretch
    along_n_per_kg = GRAVITY_M_S2 * (struts.unit @ DOWN)
    hanging = masses.screw_kg * struts.length_mm / masses.screw_length_mm if masses.screw_kg else 0.0
    return stretch + along_n_per_kg * (fixed * _moving_kg(masses) + growing * (masses.strut_kg + hanging) / 2.0)


def motor_loads(
    struts: Struts, tension_n: NDArray[np.float64], masses: StrutMasses | None = None
) -> NDArray[np.float64]:
    """Axial forces that the motors hold, positive where the platform pulls, shape (n, 6) [N].

    The tension at the platform joint and the weight along the axis of what the motor moves. By virtual work this is
    what all potential energy gains when one motor shortens its strut.

    Args:
        tension_n: at the platform joints, shape (n, 6) [N].
        masses: of every strut; None for struts without weight.
    """
    if masses is None:
        return tension_n
    return tension_n + _moving_kg(masses) * GRAVITY_M_S2 * (struts.unit @ DOWN)


def _moving_kg(masses: StrutMasses) -> float:
    """Mass that a motor moves along its strut: the screw, and half of a telescope that stays even at every length."""
    return masses.screw_kg + masses.strut_kg / 2.0


def base_loads(
    struts: Struts, tension_n: NDArray[np.float64], masses: StrutMasses | None = None
) -> NDArray[np.float64]:
    """Forces of the struts on the base at its joints, machine axes, shape (n, 6, 3) [N].

    A strut at rest hands on to the base what the platform does to it, T u - f, and its own weight.

    Args:
        tension_n: at the platform joints, shape (n, 6) [N].
        masses: of every strut; None for struts without weight.
    """
    load = tension_n[:, :, None] * struts.unit
    if masses is None:
        return load
    weight = (masses.strut_kg + masses.motor_kg + masses.screw_kg) * GRAVITY_M_S2 * DOWN
    return load - transverse_pull(struts, masses) + weight
