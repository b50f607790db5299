"""What the sources that gravity causes take from the machine file, and what they assume where it is silent."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import Compliance
from dbbstation.machine.kinematics import inverse
from dbbstation.machine.statics import motor_loads, platform_weight, strut_tensions, transverse_load, transverse_pull

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Hexapod, Machine, Masses
    from dbbstation.machine.kinematics import Struts
    from dbbstation.machine.rotation import Frames

MM_PER_N = 1e-6
"""One µm/kN in mm/N."""

USUAL_UM_KN = 10.0
"""Compliance of a strut of 1000 mm where the machine file states none: that of the PM-600's kind of machine [µm/kN]."""


def strut_compliance(machine: Machine) -> Compliance:
    """Compliance of the struts as the machine file states it, else the usual one."""
    return machine.compliance or Compliance(at_1000mm_mm_per_n=USUAL_UM_KN * MM_PER_N)


def for_such_struts(machine: Machine) -> str:
    """Say which compliance a parameter is counted with that circles show only multiplied by it."""
    usual = f"{strut_compliance(machine).at_1000mm_mm_per_n / MM_PER_N:.3g} µm/kN at 1000 mm"
    return f"counted with the compliance of gravity, or {usual} without it"


def platform_masses(source: str, machine: Machine) -> Masses:
    """Masses of the platform.

    Raises:
        ModelError: the machine file has none; names the source and the key.
    """
    if machine.masses is None:
        raise ModelError(
            f"the error source {source} needs the platform's mass and centre of gravity, and the machine "
            f"{machine.name!r} has no `masses`",
            remedy="add `masses: {platform_kg: ..., centre_of_gravity_above_tip_mm: ...}` to the machine file, "
            "a weight off the drawing will do, as circles show its product with the compliance; or leave this source out: "
            "the rest is fitted as before, and what gravity bends goes into joints that are wrong elsewhere",
        )
    return machine.masses


def stated_tensions(source: str, machine: Machine, frames: Frames, struts: Struts) -> NDArray[np.float64]:
    """Tensions of the struts under the weights that the machine file states, at platform joints, shape (n, 6) [N].

    Args:
        source: who asks, for the message.
        machine: with masses, and with strut masses where these count.

    Raises:
        ModelError: the machine file has no masses.
        KinematicsError: a pose where the struts cannot hold the platform.
    """
    load = platform_weight(frames, platform_masses(source, machine))
    if machine.strut_masses is not None:
        load += transverse_load(struts, transverse_pull(struts, machine.strut_masses))
    return strut_tensions(struts, load)


def stated_loads(source: str, machine: Machine, frames: Frames, hexapod: Hexapod) -> NDArray[np.float64]:
    """What the motors hold under the weights that the machine file states, shape (n, 6) [N].

    Args:
        source: who asks, for the message.
        machine: with masses, and with strut masses where these count.
        hexapod: joints, nominal or actual.

    Raises:
        ModelError: the machine file has no masses.
        KinematicsError: a pose where the struts cannot hold the platform.
    """
    struts = inverse(hexapod, frames)
    return motor_loads(struts, stated_tensions(source, machine, frames, struts), machine.strut_masses)
