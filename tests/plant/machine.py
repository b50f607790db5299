"""The hexapod of the plant: joint geometry, masses, and the reference machine.

The reference machine is an assumption: the papers print neither joint coordinates nor masses of the PM-600. Its
dimensions were chosen so that the circularity under gravity comes near the values measured in [GRAV Table 4].
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.rotation import Convention

GRAVITY_M_S2 = 9.81
TRAVEL: dict[str, float | list[float]] = {
    "xy_radius_mm": 300,
    "x_mm": [-300, 300],
    "y_mm": [-300, 300],
    "z_mm": [-1208, -808],
    "a_deg": [-26, 26],
    "b_deg": [-26, 26],
    "c_deg": [-5, 5],
    "strut_mm": [300, 1380],
}


def _no_length_errors() -> FloatArray:
    return np.zeros(6)


@dataclass(frozen=True)
class Machine:
    """A hexapod: base joints `(6, 3)` in the machine frame, platform joints `(6, 3)` in the platform frame [mm].

    The platform hangs below the base (Z up), the origin of the platform frame is the tool tip. The controller drives
    strut i to its nominal length minus `reference_length_error_mm[i]`.
    """

    base_joints_mm: FloatArray
    platform_joints_mm: FloatArray
    rotation: Convention = "Rx(A) Ry(B) Rz(C)"
    reference_length_error_mm: FloatArray = field(default_factory=_no_length_errors)
    screw_lead_mm: float = 10.0
    platform_kg: float = 400.0
    centre_of_gravity_mm: tuple[float, float, float] = (0.0, 0.0, 500.0)
    name: str = "PM-600-like reference"


def _on_circle(radius_mm: float, angles_deg: list[float], z_mm: float) -> FloatArray:
    angle_rad = np.radians(angles_deg)
    return np.stack([radius_mm * np.cos(angle_rad), radius_mm * np.sin(angle_rad), np.full(6, z_mm)], axis=1)


def reference_machine() -> Machine:
    """Three close pairs of base joints on radius 735 mm, platform joints on radius 395 mm, 500 mm above the tip.

    Each strut runs from its base joint to the nearer platform joint of the neighbouring pair.
    """
    return Machine(
        base_joints_mm=_on_circle(735.0, [95, 205, 215, 325, 335, 85], 0.0),
        platform_joints_mm=_on_circle(395.0, [140, 160, 260, 280, 20, 40], 500.0),
    )


def random_machine(seed: int, spread_mm: float = 3.0, rotation: Convention = "Rx(A) Ry(B) Rz(C)") -> Machine:
    """Another machine of the same kind: every joint coordinate moved by up to `spread_mm` either way."""
    rng = np.random.default_rng([seed, 735])
    machine = reference_machine()
    return replace(
        machine,
        base_joints_mm=machine.base_joints_mm + rng.uniform(-spread_mm, spread_mm, (6, 3)),
        platform_joints_mm=machine.platform_joints_mm + rng.uniform(-spread_mm, spread_mm, (6, 3)),
        rotation=rotation,
        name=f"PM-600-like random {seed}",
    )


def rounded(machine: Machine) -> Machine:
    """The machine with its joints as a machine file prints them, to the nanometre.

    The controller and whoever reads the file then hold the same numbers.
    """
    return replace(
        machine,
        base_joints_mm=np.round(machine.base_joints_mm, 6),
        platform_joints_mm=np.round(machine.platform_joints_mm, 6),
        reference_length_error_mm=np.round(machine.reference_length_error_mm, 6),
    )
