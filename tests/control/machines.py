"""Three machines with every source that a kinematics can hold."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import Compliance, Frames, Hexapod, JointAxes, Masses, Rotation, StrutMasses
from dbbstation.machine.kinematics import inverse, strut_jacobian
from dbbstation.machine.travel import middle
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted, Need, Owner
from dbbstation.sources.registry import known_sources

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import ErrorSource

THERMOMETERS = ("machine",)


def machine(reference: Machine, number: int) -> Machine:
    """The reference machine; with another order of rotation and heavy struts; with joints elsewhere."""
    drawn = np.random.default_rng(number)
    own = reference.hexapod
    level = np.cross(inverse(own, middle(reference)).unit[0], [0.0, 0.0, 1.0])
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    masses = StrutMasses(25.0, 20.0, 300.0, 12.0, 1500.0) if number else None
    spread = 10.0 if number == 2 else 0.0
    return replace(
        reference,
        hexapod=Hexapod(
            own.base_joints_mm + drawn.normal(0.0, spread, (6, 3)),
            own.platform_joints_mm + drawn.normal(0.0, spread, (6, 3)),
            Rotation.ZYX if number == 1 else Rotation.XYZ,
        ),
        reference_length_error_mm=drawn.normal(0.0, 0.1, 6),
        masses=Masses(400.0, 500.0),
        strut_masses=masses,
        compliance=Compliance(8e-6, 0.8),
        joint_axes=JointAxes(level, level),
        screw_lead_mm=10.0,
    )


def fitted(source: ErrorSource, of: Machine, seed: int) -> Fitted:
    """Values of about the usual sizes; shape parameters within their grids."""
    drawn = np.random.default_rng([seed, *source.name.encode()])
    values = []
    for parameter in source.parameters(of):
        size = abs(drawn.normal(0.0, 1.0)) if parameter.positive else drawn.normal(0.0, 1.0)
        values.append(drawn.choice(parameter.grid) if parameter.grid else parameter.plausible * size)
    return Fitted(source, np.array(values))


def pose_sources() -> list[ErrorSource]:
    """Every source and law of the machine's that hangs on pose, length or temperature alone."""
    found = []
    for source in known_sources().values():
        for law in (source, *source.other_laws()):
            by_temperature = Need.TEMPERATURE in law.needs and Need.CURRENT not in law.needs
            if law.belongs_to is Owner.MACHINE and (law.needs <= {Need.POSE} or by_temperature):
                found.append(law)
    return found


def poses(of: Machine, count: int, seed: int) -> NDArray[np.float64]:
    """Poses in 0.8 of the travel where the struts hold the platform, shape (count, 6) [mm, deg].

    Held is a Jacobian determinant of at least a tenth of the middle's; a loose machine amplifies every error without end.
    """
    drawn = np.random.default_rng(seed)
    travel = of.travel
    limits = np.array([travel.x_mm, travel.y_mm, travel.z_mm, travel.a_deg, travel.b_deg, travel.c_deg])
    half = 0.4 * np.diff(limits)[:, 0]
    given = limits.mean(axis=1) + drawn.uniform(-half, half, (20 * count, 6))
    struts = inverse(of.hexapod, Frames.from_poses(given, of.hexapod.rotation))
    held = np.linalg.det(strut_jacobian(struts)) / np.linalg.det(strut_jacobian(inverse(of.hexapod, middle(of))))
    low, high = travel.strut_mm[0] + 5.0, travel.strut_mm[1] - 5.0
    inside = ((struts.length_mm > low) & (struts.length_mm < high)).all(axis=1)
    inside &= (np.hypot(given[:, 0], given[:, 1]) < travel.xy_radius_mm) & (held > 0.1)
    assert inside.sum() >= count
    return given[inside][:count]


def model_of(of: Machine, sources: list[ErrorSource], seed: int) -> MachineModel:
    return MachineModel(of, tuple(fitted(source, of, seed) for source in sources))
