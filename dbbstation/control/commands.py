"""Commands that a correcting control actually drives."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import ControlCorrection
from dbbstation.model.compensation import compensated
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted, Motion, Need

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import ErrorSource


def correction_of(
    kind: Literal["kinematics", "parameters"], digest: str, date: str, taken_out: Iterable[Fitted], machine: Machine
) -> ControlCorrection:
    """Return a control's correction in the form of a machine file."""
    sources = {fitted.source.name: fitted.by_name(machine) for fitted in taken_out}
    return ControlCorrection(kind, digest, date, sources)


def nominal_commands(machine: Machine, poses: Floats, known: Mapping[str, ErrorSource]) -> Floats:
    """Return poses, shape (n, 6) [mm, deg], that would make a nominal control drive the same strut lengths as this control.

    Raises:
        ModelError: an unknown source, or one that follows more than the pose.
        KinematicsError: a pose that the machine cannot take.
    """
    if machine.control is None or not len(poses):
        return poses
    taken_out = tuple(_fitted(name, dict(values), machine, known) for name, values in machine.control.sources.items())
    return compensated(MachineModel(machine, taken_out), Motion(poses))


def _fitted(name: str, values: Mapping[str, float], machine: Machine, known: Mapping[str, ErrorSource]) -> Fitted:
    source = known.get(name)
    laws = () if source is None else (source, *source.other_laws())
    for law in laws:
        names = [parameter.name for parameter in law.parameters(machine)]
        if set(names) == set(values) and law.needs <= {Need.POSE}:
            return Fitted(law, np.array([values[each] for each in names]))
    raise ModelError(
        f"the control corrects the source {name}, which is unknown, has other parameters or depends on more than the pose",
        where="`control` of the machine file",
        remedy="switch the parts that follow thermometers off while measuring, and take them out of `control`",
    )
