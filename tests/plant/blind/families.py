"""What every effect of the list could do to a session, with all its amplitudes free: an outsider must be none of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.bar import BarDrift
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.joints import JointFriction, JointRunout
from tests.plant.mechanisms.play import Play
from tests.plant.mechanisms.screw import ScrewCyclic, ScrewLead
from tests.plant.mechanisms.servo import ReversalSpike, ServoLag
from tests.plant.mechanisms.set_up import BallForm, JigDistortion, ToolBallOffset
from tests.plant.mechanisms.thermal import JigThermal, SpindleGrowth, ThermalFrame, ThermalStruts
from tests.plant.mechanisms.warming import Warming
from tests.plant.mechanisms.weights import BaseCompliance, StrutBending

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.plant.arrays import FloatArray
    from tests.plant.linear import LinearSession
    from tests.plant.mechanisms.base import Mechanism

EVEN = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
TIME_CONSTANTS_S = (600.0, 2400.0)


def families(session: LinearSession) -> dict[str, FloatArray]:
    """Columns `(m, d)` of every effect by its name; warming with more than one time constant."""

    def of(*mechanisms: Mechanism) -> FloatArray:
        return np.stack([session.signature([item]) for item in mechanisms], axis=1)

    laws = [Warming(1.0, tau_s) for tau_s in TIME_CONSTANTS_S]
    joints = [
        JointFriction(shares=tuple(float(k == strut) for k in range(6)))  # type: ignore[arg-type]
        for strut in range(6)
    ]
    return {
        "gravity": of(Gravity(), BaseCompliance((1e-6, 1e-6, 0.0)), BaseCompliance((0.0, 0.0, 1e-6))),
        "strut-bending": of(StrutBending()),
        "backlash": session.by_strut(Backlash(EVEN)),
        "play": session.by_strut(Play(EVEN)),
        "reversal-spike": session.by_strut(ReversalSpike(EVEN)),
        "screw-lead": session.by_strut(ScrewLead(EVEN)),
        "screw-cyclic": np.concatenate(
            [session.by_strut(ScrewCyclic(EVEN, (phase,) * 6)) for phase in (0.0, 90.0)],  # type: ignore[arg-type]
            axis=1,
        ),
        "servo-lag": session.by_strut(ServoLag(EVEN)),
        "joint-friction": of(*joints),
        "joint-runout": np.concatenate([session.by_strut(JointRunout(*arms)) for arms in _arms()], axis=1),
        "thermal": of(*(kind(law) for kind in (ThermalStruts, ThermalFrame, SpindleGrowth, BarDrift) for law in laws)),
        "jig": of(JigThermal(), *(JigDistortion(along_deg=angle) for angle in (0.0, 60.0, 120.0))),
        "tool-ball-offset": of(*(ToolBallOffset(tuple(row)) for row in np.eye(3))),  # type: ignore[arg-type]
        "platform-joints": session.platform_joints,
        "ball-form": of(*(BallForm(((n, 1.0, phase),)) for n in (2, 3, 4, 5) for phase in (0.0, 90.0))),
        "ball-coordinate": session.shifts(lambda slot: slot.test.ball),
        "mounting": session.shifts(lambda slot: slot.mounting),
    }


def _arms() -> Iterator[tuple[FloatArray, FloatArray]]:
    """Eccentricities of all joints along one axis [µm], of the base, then of the platform, `(6, 3)` each."""
    for axis in np.eye(3):
        yield np.tile(axis, (6, 1)), np.zeros((6, 3))
        yield np.zeros((6, 3)), np.tile(axis, (6, 1))
