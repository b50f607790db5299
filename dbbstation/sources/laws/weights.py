"""Weights and screws of the machine file, with defaults."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import Compliance, StrutMasses
from dbbstation.machine.statics import motor_loads, platform_weight, strut_tensions, transverse_load, transverse_pull

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Frames, Machine, Masses
    from dbbstation.machine.kinematics import Struts


MM_PER_N = 1e-6
"""One µm/kN in mm/N."""

USUAL_UM_KN = 10.0
"""Compliance of a strut of 1000 mm if the machine file states none, as for machines like the PM-600 [µm/kN]."""


def strut_compliance(machine: Machine) -> Compliance:
    """Return the struts' compliance from the machine file, else the usual one."""
    return machine.compliance or Compliance(at_1000mm_mm_per_n=USUAL_UM_KN * MM_PER_N)


def for_such_struts(machine: Machine) -> str:
    """Return a text on the compliance assumed for a parameter."""
    usual = f"{strut_compliance(machine).at_1000mm_mm_per_n / MM_PER_N:.3g} µm/kN at 1000 mm"
    return f"counted with the compliance of gravity, or {usual} without it"


def platform_masses(source: str, machine: Machine) -> Masses:
    """Return the platform's masses.

    Raises:
        ModelError: the machine file has none; names source and key.
    """
    if machine.masses is None:
        raise ModelError(
            f"the error source {source} needs the platform's mass and centre of gravity, and the machine "
            f"{machine.name!r} has no `masses`",
            remedy="add `masses: {platform_kg: ..., centre_of_gravity_above_tip_mm: ...}` to the machine file; "
            "a weight from the drawing is enough, since circles determine its product with the compliance; or leave this source out, "
            "and the fitted joints absorb gravity",
        )
    return machine.masses


def stated_tensions(source: str, machine: Machine, frames: Frames, struts: Struts) -> Floats:
    """Return tensions under the machine file's weights, at platform joints, shape (n, 6) [N]."""
    load = platform_weight(frames, platform_masses(source, machine))
    if machine.strut_masses is not None:
        load += transverse_load(struts, transverse_pull(struts, machine.strut_masses))
    return strut_tensions(struts, load)


def stated_loads(source: str, machine: Machine, frames: Frames, struts: Struts) -> Floats:
    """Return motor loads under the machine file's weights, shape (n, 6) [N].

    Args:
        struts: with nominal or actual joints.
    """
    return motor_loads(struts, stated_tensions(source, machine, frames, struts), machine.strut_masses)


def masses_for_c(masses: StrutMasses | None) -> Floats:
    """Return a strut's masses and lengths as arguments of `strut_load` in `control/kernel.c`, shape (5,) [kg, mm]."""
    own = masses or StrutMasses(strut_kg=0.0, motor_kg=0.0, motor_length_mm=0.0)
    return np.array([own.strut_kg, own.motor_kg, own.motor_length_mm, own.screw_kg, own.screw_length_mm])


def screw_lead_mm(source: str, machine: Machine) -> float:
    """Return a strut's travel per screw turn [mm]."""
    if machine.screw_lead_mm is None:
        raise ModelError(
            f"the error source {source} needs the lead of the struts' screws, and the machine {machine.name!r} has no "
            "`screw_lead_mm`",
            remedy="add `screw_lead_mm: ...` to the machine file, or leave this source out",
        )
    return machine.screw_lead_mm
