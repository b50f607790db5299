"""What the sources that gravity causes take from the machine file, and what they assume where it is silent."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import Compliance

if TYPE_CHECKING:
    from dbbstation.machine.geometry import Machine, Masses

MM_PER_N = 1e-6
"""One µm/kN in mm/N."""

USUAL_UM_KN = 10.0
"""Compliance of a strut of 1000 mm where the machine file states none: that of the PM-600's kind of machine [µm/kN]."""


def strut_compliance(machine: Machine) -> Compliance:
    """Compliance of the struts as the machine file states it, else the usual one."""
    return machine.compliance or Compliance(at_1000mm_mm_per_n=USUAL_UM_KN * MM_PER_N)


def for_such_struts(machine: Machine) -> str:
    """Say which compliance a parameter was counted with that circles show only multiplied by it."""
    return f"counted with struts of {strut_compliance(machine).at_1000mm_mm_per_n / MM_PER_N:.3g} µm/kN at 1000 mm"


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
            "or leave this source out",
        )
    return machine.masses
