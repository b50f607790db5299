"""Gravity hidden in a kinematic calibration: small residuals on the jig, a wrong tool elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.calibration.fit.calibrate import calibrate, default_sources
from dbbstation.calibration.reporting.evaluation import rms_um
from dbbstation.diagnosis.diagnose import diagnose
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted, Motion
from dbbstation.sources.registry import known_sources, sources_named
from dbbstation.trace.analysis import best_circle
from dbbstation.virtual.truth import random_kinematics
from studies.virtual_session import draw_session

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from dbbstation.diagnosis.findings import Diagnosis
    from dbbstation.machine.geometry import Machine
    from dbbstation.plan.plan import Plan

COMPLIANCE_UM_KN = 9.68
NOISE_MM = 0.0005
CANDIDATES = ("gravity", "backlash", "thermal-struts", "bar-drift")
TILTED = "A"
"""Condition of [GRAV Table 2]: circle about (0, 100, -1008) mm, radius 144 mm, tilted by -23 degrees about X."""


@dataclass(frozen=True, eq=False)
class ConcealedGravity:
    """What the study found.

    Attributes:
        numbers: for `--json` and text.
        theta_deg: of the tilted circle, shape (n,).
        left_um: its centred radial deviation, by compensation, shape (n,) each.
        per_test_um: (name, kinematic residual, joint residual) per jig test, rms.
    """

    numbers: dict[str, Any]
    theta_deg: NDArray[np.float64]
    left_um: dict[str, NDArray[np.float64]]
    per_test_um: list[tuple[str, float, float]]
    diagnosis: Diagnosis


def concealed_gravity(
    machine: Machine, jig: Plan, conditions: Plan, seed: int, progress: Callable[[str], None]
) -> ConcealedGravity:
    """Draw a machine with gravity, calibrate kinematically, diagnose, look elsewhere.

    Args:
        jig: the fifteen circles of [CAL Table II].
        conditions: the nine of [GRAV Table 4].
    """
    rng = np.random.default_rng(seed)
    kinematics = random_kinematics(machine, seed)
    gravity = Fitted(known_sources()["gravity"], np.array([COMPLIANCE_UM_KN]))
    truth = MachineModel(machine, (*kinematics, gravity))
    progress("a session on the jig plate")
    session = draw_session(truth, jig, rng, NOISE_MM)
    without = draw_session(MachineModel(machine, kinematics), jig, np.random.default_rng(seed), NOISE_MM)
    clean = calibrate(machine, without, default_sources())
    found = diagnose(machine, session, sources_named(CANDIDATES), progress)
    theta = np.arange(0.0, 360.0, 0.5)
    models = {
        "nothing": MachineModel(machine),
        "kinematic calibration": found.before.model.of_the_machine(),
        "kinematics and gravity together": found.after.model.of_the_machine(),
    }
    left, centres, worst = {}, {}, {}
    for name, model in models.items():
        deviation, centre, greatest = _left_um(truth, model, conditions, theta)
        left[name], centres[name], worst[name] = deviation, centre, greatest
    gravity_finding = next(f for f in found.sources if f.name == "gravity")
    shifts = np.array([shift.shift_um for shift in found.shifts if shift.parameter.startswith("base-joints")])
    value = gravity_finding.parameters["strut_compliance_um_kn"]
    held_out = [1e3 * predicted.rms for predicted in found.held_out]
    numbers = {
        "seed": seed,
        "residual_um": {
            "without_gravity_in_the_machine": rms_um(clean.residual_mm),
            "kinematic": rms_um(found.before.residual_mm),
            "joint": rms_um(found.after.residual_mm),
        },
        "held_out_um": {"kinematic": held_out[0], "joint": held_out[1]},
        "verdict": str(gravity_finding.verdict),
        "concealed": gravity_finding.concealed,
        "signature_um": gravity_finding.signature_rms_um,
        "unconcealed_um": gravity_finding.unconcealed_rms_um,
        "compliance_um_kn": {"true": COMPLIANCE_UM_KN, "found": value.value, "uncertainty": value.uncertainty},
        "base_joint_shift_um": {"greatest": float(np.abs(shifts).max(initial=0.0)), "rms": _rms(shifts)},
        "tilted_circle": {
            name: {
                "circularity_um": float(np.ptp(left[name])),
                "centre_deviation_um": centres[name],
                "greatest_position_error_um": worst[name],
            }
            for name in models
        },
    }
    return ConcealedGravity(numbers, theta, left, _per_test(found), found)


def _left_um(
    truth: MachineModel, model: MachineModel, conditions: Plan, theta_deg: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float, float]:
    """Return the tilted circle's residual under a model's compensation, to first order.

    Returns:
        Radial deviation about its own centre, shape (n,) [µm]; centre deviation [µm]; greatest position error [µm].
    """
    circle = conditions.tests[TILTED].circle
    motion = Motion(circle.poses(theta_deg), is_path=True)
    off = truth.actual_poses(motion)[:, :3] - model.actual_poses(motion)[:, :3]
    angle = np.radians(theta_deg)
    outwards = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))])
    centre, _, deviation = best_circle(theta_deg, circle.radius_mm + np.sum(off * outwards, axis=1))
    return 1e3 * deviation, 1e3 * float(np.hypot(*centre)), 1e3 * float(np.linalg.norm(off, axis=1).max())


def _per_test(found: Diagnosis) -> list[tuple[str, float, float]]:
    names = list(dict.fromkeys(o.test for o in found.before.observations))
    rows = []
    for name in names:
        runs = [k for k, o in enumerate(found.before.observations) if o.test == name]
        before = rms_um([found.before.residual_mm[k] for k in runs])
        rows.append((name, before, rms_um([found.after.residual_mm[k] for k in runs])))
    return rows


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
