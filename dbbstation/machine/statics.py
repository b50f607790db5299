"""Statics: gravity and the force of every strut.

Forces [N] and moments about the tool tip [N mm] in machine axes, Z up; a strut's unit vector points from base to
platform, tension is positive. Strut i pulls the platform by -T_i u_i; equilibrium under (F, M) is sum T_i u_i = F and sum
T_i (R P_i) x u_i = M, or J^T T = [F, M] with J = [u, (R P) x u].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.compiled import in_blocks
from dbbstation.errors import KinematicsError
from dbbstation.machine import kernels
from dbbstation.machine.geometry import STRUTS

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Compliance, Frames, Masses, StrutMasses
    from dbbstation.machine.kinematics import Struts

GRAVITY_M_S2 = 9.81
"""Acceleration of gravity; it differs by up to 0.3 % between places on Earth [m/s²]."""

DOWN = np.array([0.0, 0.0, -1.0])
"""Direction of gravity in the machine frame [1]."""


@dataclass(frozen=True)
class Load:
    """Load on the platform, without axial strut forces.

    Attributes:
        force_n: machine axes, shape (n, 3).
        moment_n_mm: about the tool tip, machine axes, shape (n, 3).
    """

    force_n: Floats
    moment_n_mm: Floats

    def __add__(self, other: Load) -> Load:
        return Load(self.force_n + other.force_n, self.moment_n_mm + other.moment_n_mm)


def platform_weight(frames: Frames, masses: Masses) -> Load:
    """Return the platform's weight at its centre of gravity: [W, r_G x W], W = m g.

    The mass is the platform's own. [GRAV eq 1] uses the mass of the entire system, although base joints carry part of it.
    """
    weight = masses.platform_kg * GRAVITY_M_S2 * DOWN
    lever = frames.rotation[:, :, 2] * masses.centre_of_gravity_above_tip_mm
    return Load(np.broadcast_to(weight, lever.shape), np.cross(lever, weight))


def transverse_pull(struts: Struts, masses: StrutMasses) -> Floats:
    """Return each strut's transverse pull by its weight, shape (n, 6, 3) [N].

    A rod about its base joint with masses m_k at s_k along u weighs sum m_k s_k (u x g). The reaction on the platform is
    f = sum m_k s_k / L * g_across, g_across = g - u (u g). [GRAV eq 2] prints the opposite sign.
    """
    across = GRAVITY_M_S2 * (DOWN - struts.unit * (struts.unit @ DOWN)[:, :, None])
    return (_first_moment_kg_mm(struts, masses) / struts.length_mm)[:, :, None] * across


def _first_moment_kg_mm(struts: Struts, masses: StrutMasses) -> Floats:
    """Return the first moment of a strut's masses about its base joint, shape (n, 6) [kg mm]."""
    length = struts.length_mm
    return (
        masses.strut_kg * length / 2.0
        - masses.motor_kg * masses.motor_length_mm / 2.0
        + masses.screw_kg * (length - masses.screw_length_mm / 2.0)
    )


def transverse_load(struts: Struts, pull_n: Floats) -> Load:
    """Return the platform load by the struts' transverse pulls: [sum f, sum (R P) x f].

    [GRAV eq 3 and 6] contain the moment, but [GRAV eq 1] omits the force.
    """
    return Load(pull_n.sum(axis=1), np.cross(struts.arm_mm, pull_n).sum(axis=1))


def strut_tensions(struts: Struts, load: Load) -> Floats:
    """Return axial forces at platform joints, tension positive, shape (n, 6) [N].

    Solves J^T T = [F, M] [GRAV eq 1 and 6]. The result has a sign; eq 7 uses the magnitude.

    Raises:
        KinematicsError: the struts cannot hold the platform at a pose.
    """
    count = len(struts.length_mm)
    tension = np.empty((count, STRUTS))
    outcome = np.empty(count, dtype=np.int64)
    force, moment = np.ascontiguousarray(load.force_n), np.ascontiguousarray(load.moment_n_mm)

    in_blocks(kernels.adjoint, count, struts.unit, struts.arm_mm, force, moment, tension, outcome)
    if (outcome != kernels.CONVERGED).any():
        raise KinematicsError(
            "the struts cannot hold the platform there (singular pose)",
            where=f"pose {int(np.argmax(outcome != kernels.CONVERGED)) + 1}",
            remedy="check the machine file's joints and the commanded pose",
        )
    return tension


def compliance_mm_per_n(length_mm: Floats, compliance: Compliance) -> tuple[Floats, Floats]:
    """Return a strut's compliance: a constant part and a part proportional to length.

    [GRAV eq 7] gives K (alpha L + C_B); alpha, printed S/E, means 1/(S E). With the compliance c at 1000 mm and its
    growing share s, the parts are c (1 - s) and c s L / 1000 mm. Both have shape (n, 6) [mm/N].
    """
    at_1000mm, share = compliance.at_1000mm_mm_per_n, compliance.growing_share
    return np.full(length_mm.shape, at_1000mm * (1.0 - share)), at_1000mm * share * length_mm / 1000.0


def stretch_mm(struts: Struts, compliance: Compliance, tension_n: Floats, masses: StrutMasses | None = None) -> Floats:
    """Return elastic elongation, shape (n, 6) [mm] [GRAV eq 7].

    [GRAV eq 7] omits the strut's own axial weight, which stretches the sections above it. `motor_loads` act on the
    constant part. On the growing part, an even rod counts with half its weight. A screw of length l with L below the
    joint counts with L / (2 l) of its weight; the motor does not count.
    """
    fixed, growing = compliance_mm_per_n(struts.length_mm, compliance)
    stretch = (fixed + growing) * tension_n
    if masses is None:
        return stretch
    along_n_per_kg = GRAVITY_M_S2 * (struts.unit @ DOWN)
    hanging = masses.screw_kg * struts.length_mm / masses.screw_length_mm if masses.screw_kg else 0.0
    return stretch + along_n_per_kg * (fixed * _moving_kg(masses) + growing * (masses.strut_kg + hanging) / 2.0)


def motor_loads(struts: Struts, tension_n: Floats, masses: StrutMasses | None = None) -> Floats:
    """Return the motors' axial forces, positive if the platform pulls, shape (n, 6) [N].

    By virtual work, this is the tension plus the axial weight of the moving parts.
    """
    if masses is None:
        return tension_n
    return tension_n + _moving_kg(masses) * GRAVITY_M_S2 * (struts.unit @ DOWN)


def _moving_kg(masses: StrutMasses) -> float:
    return masses.screw_kg + masses.strut_kg / 2.0


def base_loads(struts: Struts, tension_n: Floats, masses: StrutMasses | None = None) -> Floats:
    """Return strut forces on the base joints, machine axes, shape (n, 6, 3) [N]: T u - f and own weight."""
    load = tension_n[:, :, None] * struts.unit
    if masses is None:
        return load
    weight = (masses.strut_kg + masses.motor_kg + masses.screw_kg) * GRAVITY_M_S2 * DOWN
    return load - transverse_pull(struts, masses) + weight
