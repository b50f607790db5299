"""Screw data of the machine file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import ModelError

if TYPE_CHECKING:
    from dbbstation.machine.geometry import Machine


def screw_lead_mm(source: str, machine: Machine) -> float:
    """Return a strut's travel per screw turn [mm]."""
    if machine.screw_lead_mm is None:
        raise ModelError(
            f"the error source {source} needs the lead of the struts' screws, and the machine {machine.name!r} has no "
            "`screw_lead_mm`",
            remedy="add `screw_lead_mm: ...` to the machine file, or leave this source out",
        )
    return machine.screw_lead_mm
