"""Every effect of the list of error sources, drawn at random but for its size."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.plant.blind.effect import Effect
from tests.plant.blind.warm_up import drawn_warming
from tests.plant.machine import GRAVITY_M_S2
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.balls import BadSeating, BallCoordinates
from tests.plant.mechanisms.bar import BarDrift, BarOffset
from tests.plant.mechanisms.gravity import CentreOfGravityShift, Gravity
from tests.plant.mechanisms.joints import JointFriction, JointRunout, UjointScrew
from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.mechanisms.play import Play
from tests.plant.mechanisms.screw import ScrewCyclic, ScrewLead
from tests.plant.mechanisms.servo import ReversalSpike, ServoLag, TimeSkew
from tests.plant.mechanisms.set_up import BallForm, BarCyclic, JigDistortion, ToolBallOffset
from tests.plant.mechanisms.thermal import JigThermal, SpindleGrowth, ThermalFrame, ThermalStruts
from tests.plant.mechanisms.weights import BaseCompliance, StrutBending, StrutWeight

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.mechanisms.base import Mechanism
    from tests.plant.run import Scene

ONE = np.ones(1)
REFERENCE_COMPLIANCE_UM_KN = 9.68


def _six(values: FloatArray) -> Any:
    return tuple(float(value) for value in values)


def _some_struts(rng: np.random.Generator, *, signed: bool) -> tuple[FloatArray, tuple[int, ...]]:
    """Half of the time one strut, else two, or all six, each with its own share."""
    count = int(rng.choice([1, 2, 6], p=[0.5, 0.2, 0.3]))
    struts = np.sort(rng.choice(6, count, replace=False))
    direction = np.zeros(6)
    direction[struts] = rng.uniform(0.4, 1.0, count) * (rng.choice([-1.0, 1.0], count) if signed else 1.0)
    return direction / np.abs(direction).max(), tuple(int(strut) + 1 for strut in struts)


def _per_strut(unit: str) -> tuple[str, ...]:
    return tuple(f"strut_{strut}_{unit}" for strut in range(1, 7))


def _vector(rng: np.random.Generator, count: int = 3) -> FloatArray:
    values = rng.standard_normal(count)
    return values / np.abs(values).max()


def _gravity(rng: np.random.Generator, scene: Scene) -> Effect:
    del rng, scene
    return Effect(
        "gravity",
        lambda a: Gravity(1e-6 * float(a[0])),
        ONE,
        "µm/kN",
        20.0,
        variables=("strut-force",),
        keys=("strut_compliance_um_kn",),
        carrier_amplitude=REFERENCE_COMPLIANCE_UM_KN,
    )


def _cog_shift(rng: np.random.Generator, scene: Scene) -> Effect:
    return Effect(
        "cog-shift",
        lambda a: CentreOfGravityShift(_six(a)),
        _vector(rng),
        "mm",
        40.0,
        variables=("strut-force",),
        keys=("x_mm", "y_mm", "z_mm"),
        carriers=(_gravity(rng, scene),),
    )


def _strut_weight(rng: np.random.Generator, scene: Scene) -> Effect:
    return Effect(
        "strut-weight",
        lambda a: StrutWeight(rod_kg=float(a[0]), motor_kg=0.0),
        ONE,
        "kg",
        60.0,
        variables=("strut-force",),
        keys=("strut_kg",),
        carriers=(_gravity(rng, scene),),
    )


def _base_compliance(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    return Effect(
        "base-compliance",
        lambda a: BaseCompliance((1e-6 * float(a[0]), 1e-6 * float(a[0]), 1e-6 * float(a[1]))),
        np.array([rng.uniform(0.2, 1.0), 1.0]),
        "µm/kN",
        8.0,
        variables=("strut-force",),
        keys=("horizontal_um_kn", "vertical_um_kn"),
    )


def _strut_bending(rng: np.random.Generator, scene: Scene) -> Effect:
    """The amplitude is the shortening of a level strut of 750 mm."""
    del rng, scene
    load_n_mm = 25.0 * GRAVITY_M_S2 / 750.0

    def make(a: FloatArray) -> Mechanism:
        shortening_mm = max(float(a[0]), 1e-12) / 1000.0
        return StrutBending(
            bending_stiffness_n_mm2=load_n_mm * float(np.sqrt(17.0 / 40320.0 * 750.0**7 / shortening_mm))
        )

    return Effect("strut-bending", make, ONE, "µm", 10.0, variables=("strut-length",))


def _backlash(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    direction, struts = _some_struts(rng, signed=False)
    return Effect(
        "backlash",
        lambda a: Backlash(_six(a)),
        direction,
        "µm",
        20.0,
        struts,
        ("strut-speed-sign",),
        _per_strut("um"),
    )


def _play(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    direction, struts = _some_struts(rng, signed=False)
    friction_n = float(rng.uniform(50.0, 300.0))
    return Effect(
        "play",
        lambda a: Play(_six(a), friction_n),
        direction,
        "µm",
        20.0,
        struts,
        ("strut-force",),
        _per_strut("um"),
    )


def _reversal_spike(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    direction, struts = _some_struts(rng, signed=False)
    decay_s = float(np.exp(rng.uniform(np.log(0.1), np.log(0.6))))
    return Effect(
        "reversal-spike",
        lambda a: ReversalSpike(_six(a), decay_s),
        direction,
        "µm",
        20.0,
        struts,
        ("strut-speed-sign",),
    )


def _screw_lead(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    direction, struts = _some_struts(rng, signed=True)
    return Effect(
        "screw-lead",
        lambda a: ScrewLead(_six(a), zero_mm=737.0),
        direction,
        "µm/m",
        150.0,
        struts,
        ("strut-length",),
        _per_strut("um_m"),
    )


def _common_lead(rng: np.random.Generator, scene: Scene) -> Effect:
    alone = _screw_lead(rng, scene)
    return replace(alone, direction=rng.choice([-1.0, 1.0]) * np.ones(6), struts=())


def _screw_cyclic(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    shares, struts = _some_struts(rng, signed=False)
    phase_rad = rng.uniform(0.0, 2 * np.pi, 6)
    direction = np.stack([shares * np.cos(phase_rad), shares * np.sin(phase_rad)], axis=1).ravel()
    direction /= np.abs(direction).max()

    def make(a: FloatArray) -> Mechanism:
        sine, cosine = a.reshape(6, 2).T
        return ScrewCyclic(_six(np.hypot(sine, cosine)), _six(np.degrees(np.arctan2(cosine, sine))))

    keys = tuple(f"strut_{strut}_{part}_um" for strut in range(1, 7) for part in ("sine", "cosine"))
    return Effect("screw-cyclic", make, direction, "µm", 10.0, struts, ("strut-length",), keys)


def _servo_lag(rng: np.random.Generator, scene: Scene) -> Effect:
    """Never all six alike: a common lag is a time skew."""
    del scene
    direction, struts = _some_struts(rng, signed=False)
    return Effect(
        "servo-lag",
        lambda a: ServoLag(_six(a)),
        direction,
        "ms",
        20.0,
        struts,
        ("strut-speed",),
        _per_strut("ms"),
    )


def _joint_friction(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    direction, struts = _some_struts(rng, signed=False)
    wind_up_urad = float(rng.uniform(30.0, 300.0))
    return Effect(
        "joint-friction",
        lambda a: JointFriction(1.0e3, wind_up_urad, shares=_six(a)),
        direction,
        "N m",
        100.0,
        struts,
        ("joint", "strut-speed-sign"),
    )


def _joint_runout(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    strut = int(rng.integers(6))

    def make(a: FloatArray) -> Mechanism:
        base_um, platform_um = np.zeros((6, 3)), np.zeros((6, 3))
        base_um[strut], platform_um[strut] = a[:3], a[3:]
        return JointRunout(base_um, platform_um)

    return Effect("joint-runout", make, _vector(rng, 6), "µm", 200.0, (strut + 1,), ("joint",))


def _ujoint_screw(rng: np.random.Generator, scene: Scene) -> Effect:
    del rng, scene
    return Effect("ujoint-screw", lambda a: UjointScrew(float(a[0])), ONE, "share of the lead", 1.0)


def _thermal_struts(rng: np.random.Generator, scene: Scene) -> Effect:
    law = drawn_warming(rng, scene)
    shares = np.ones(6) if rng.random() < 0.6 else rng.uniform(0.7, 1.3, 6)
    logged = bool(rng.random() < 0.2)
    return Effect(
        "thermal-struts",
        lambda a: ThermalStruts(law(float(a[0])), shares=_six(shares), logged=logged),
        ONE,
        "K",
        8.0,
        variables=("time",),
    )


def _thermal_frame(rng: np.random.Generator, scene: Scene) -> Effect:
    law = drawn_warming(rng, scene)
    return Effect("thermal-frame", lambda a: ThermalFrame(law(float(a[0]))), ONE, "K", 8.0, variables=("time",))


def _spindle_growth(rng: np.random.Generator, scene: Scene) -> Effect:
    law = drawn_warming(rng, scene)
    return Effect("spindle-growth", lambda a: SpindleGrowth(law(float(a[0]))), ONE, "K", 15.0, variables=("time",))


def _bar_drift(rng: np.random.Generator, scene: Scene) -> Effect:
    law = drawn_warming(rng, scene)
    return Effect("bar-drift", lambda a: BarDrift(law(float(a[0]))), ONE, "K", 8.0, variables=("time",))


def _jig_thermal(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    sign = rng.choice([-1.0, 1.0])
    return Effect("jig-thermal", lambda a: JigThermal(float(a[0])), sign * ONE, "K", 6.0, keys=("warmer_k",))


def _jig_distortion(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    along_deg = float(rng.uniform(0.0, 180.0))
    return Effect(
        "jig-distortion",
        lambda a: JigDistortion(float(a[0]), along_deg),
        rng.choice([-1.0, 1.0]) * ONE,
        "µm",
        60.0,
    )


def _tool_ball_offset(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    return Effect(
        "tool-ball-offset",
        lambda a: ToolBallOffset(_six(a)),
        _vector(rng),
        "mm",
        0.5,
        keys=("x_mm", "y_mm", "z_mm"),
    )


def _platform_joints(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    keys = tuple(f"joint_{joint}_{axis}_mm" for joint in range(1, 7) for axis in "xyz")
    return Effect(
        "platform-joints",
        lambda a: Kinematics(platform_mm=a.reshape(6, 3)),
        _vector(rng, 18),
        "mm",
        0.5,
        keys=keys,
    )


def _bar_offset(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    sign = rng.choice([-1.0, 1.0])
    return Effect("bar-offset", lambda a: BarOffset(float(a[0])), sign * ONE, "µm", 30.0)


def _bar_cyclic(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    phase_deg = float(rng.uniform(0.0, 360.0))
    return Effect(
        "bar-cyclic",
        lambda a: BarCyclic(float(a[0]), phase_deg=phase_deg),
        ONE,
        "µm",
        3.0,
        variables=("reading",),
    )


def _ball_form(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    counts = np.sort(rng.choice([2, 3, 4, 5], 2, replace=False))
    phases_deg = rng.uniform(0.0, 360.0, 2)
    return Effect(
        "ball-form",
        lambda a: BallForm(
            tuple((int(n), float(size), float(p)) for n, size, p in zip(counts, a, phases_deg, strict=True))
        ),
        np.array([1.0, rng.uniform(0.2, 1.0)]),
        "µm",
        3.0,
        variables=("angle",),
    )


def _time_skew(rng: np.random.Generator, scene: Scene) -> Effect:
    del scene
    sign = rng.choice([-1.0, 1.0])
    return Effect("time-skew", lambda a: TimeSkew(float(a[0])), sign * ONE, "ms", 60.0, keys=("late_ms",))


def _ball_coordinate(rng: np.random.Generator, scene: Scene) -> Effect:
    ball = str(rng.choice([ball.name for ball in scene.plan.balls]))
    return Effect("ball-coordinate", lambda a: BallCoordinates({ball: np.array(a)}), _vector(rng), "µm", 100.0)


def _mounting(rng: np.random.Generator, scene: Scene) -> Effect:
    mounting = int(rng.choice(sorted({slot.mounting for slot in scene.slots})))
    return Effect("mounting", lambda a: BadSeating({mounting: np.array(a)}), _vector(rng), "µm", 60.0)


LISTED: dict[str, Any] = {
    "gravity": _gravity,
    "cog-shift": _cog_shift,
    "strut-weight": _strut_weight,
    "base-compliance": _base_compliance,
    "strut-bending": _strut_bending,
    "backlash": _backlash,
    "play": _play,
    "reversal-spike": _reversal_spike,
    "screw-lead": _screw_lead,
    "screw-cyclic": _screw_cyclic,
    "servo-lag": _servo_lag,
    "joint-friction": _joint_friction,
    "joint-runout": _joint_runout,
    "ujoint-screw": _ujoint_screw,
    "thermal-struts": _thermal_struts,
    "thermal-frame": _thermal_frame,
    "spindle-growth": _spindle_growth,
    "bar-drift": _bar_drift,
    "jig-thermal": _jig_thermal,
    "jig-distortion": _jig_distortion,
    "tool-ball-offset": _tool_ball_offset,
    "platform-joints": _platform_joints,
    "bar-offset": _bar_offset,
    "bar-cyclic": _bar_cyclic,
    "ball-form": _ball_form,
    "time-skew": _time_skew,
    "ball-coordinate": _ball_coordinate,
    "mounting": _mounting,
}
"""How each is drawn, by its name in the list of error sources: a function of a random generator and the scene."""
SINGLE = tuple(name for name in LISTED if name not in {"cog-shift", "strut-weight", "ujoint-screw"})
"""What can be hidden by itself: the others need gravity beside them, or joint axes that no machine file tells."""
CONCEALED: dict[str, Any] = {
    "platform-joints": _platform_joints,
    "screw-lead": _common_lead,
    "bar-offset": _bar_offset,
    "thermal-struts": _thermal_struts,
    "thermal-frame": _thermal_frame,
    "strut-weight": _strut_weight,
    "jig-thermal": _jig_thermal,
}
"""What the kinematic calibration, or gravity beside it, swallows almost wholly."""
