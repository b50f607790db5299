"""What is different from session to session besides what is wrong: machine, plan, recorder, noise, care of the people."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.plant.drive_path import Timing
from tests.plant.machine import Machine, random_machine, reference_machine
from tests.plant.mechanisms.balls import CmmScatter, MountingScatter
from tests.plant.mechanisms.bar import RandomBarOffset
from tests.plant.mechanisms.currents import DriveCurrents
from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.noise import Noise
from tests.plant.plan import Path, Plan, elevated, table_ii_plan
from tests.plant.rotation import CONVENTIONS
from tests.plant.session import scene_of

if TYPE_CHECKING:
    from tests.plant.mechanisms.base import Mechanism
    from tests.plant.run import Scene

RATES_HZ = (5.0, 10.0, 20.0, 25.0, 50.0, 100.0, 250.0)
RATE_SHARES = (0.1, 0.2, 0.3, 0.2, 0.12, 0.05, 0.03)


@dataclass(frozen=True)
class Circumstances:
    """One session before anything is hidden in it."""

    machine: Machine
    plan: Plan
    plan_kind: str
    kinematics: Kinematics
    setup: tuple[Mechanism, ...]
    setup_factors: dict[str, float]
    noise: Noise
    rate_hz: float
    timing: Timing
    angles: bool
    crc: bool
    currents: bool
    breaks_s: dict[str, float]

    def scene(self) -> Scene:
        return scene_of(self.plan, self.machine, self.timing, self.breaks_s)

    def told(self) -> dict[str, Any]:
        return {
            "machine": self.machine.name,
            "rotation": self.machine.rotation,
            "plan": self.plan_kind,
            "rate_hz": self.rate_hz,
            "feed_mm_min": self.plan.path.feed_mm_min,
            "radius_mm": self.plan.path.radius_mm,
            "angles": self.angles,
            "currents": self.currents,
            "setup_factors": self.setup_factors,
            "breaks_s": self.breaks_s,
            "noise": {key: float(value) for key, value in vars(self.noise).items()},
        }


def drawn(rng: np.random.Generator, seed: int) -> Circumstances:
    plan, kind = _plan(rng, seed)
    rate_hz = float(rng.choice(RATES_HZ, p=RATE_SHARES))
    rotation = CONVENTIONS[int(rng.integers(2))]
    machine = random_machine(seed, rotation=rotation)
    if rng.random() < 0.3:
        machine = replace(reference_machine(), rotation=rotation)
    size_mm = float(rng.uniform(0.02, 0.1))
    kinematics = Kinematics(size_mm * rng.standard_normal(6), size_mm * rng.standard_normal((6, 3)))
    factors = {name: float(np.exp(rng.uniform(np.log(0.7), np.log(1.4)))) for name in ("mounting", "cmm", "bar")}
    setup = (
        MountingScatter(factors["mounting"]),
        CmmScatter(factors["cmm"]),
        RandomBarOffset(0.5 * factors["bar"]),
    )
    names = [test.name for test in plan.tests]
    breaks_s = {str(rng.choice(names[1:])): 1800.0} if rng.random() < 0.25 else {}
    return Circumstances(
        machine,
        plan,
        kind,
        kinematics,
        setup,
        factors,
        _noise(rng, rate_hz),
        rate_hz,
        Timing(float(rng.uniform(0.6, 2.0)), float(rng.uniform(0.1, 0.5)), float(rng.uniform(0.01, 0.06))),
        angles=bool(rng.random() < 0.3),
        crc=bool(rng.random() < 0.3),
        currents=bool(rng.random() < 0.05),
        breaks_s=breaks_s,
    )


def _plan(rng: np.random.Generator, seed: int) -> tuple[Plan, str]:
    """Table II, as it is, with three circles repeated at the end, with five bars raised, or with both."""
    path = Path(
        radius_mm=float(rng.choice([100.0, 150.0], p=[0.3, 0.7])),
        feed_mm_min=float(rng.choice([500.0, 1000.0, 1500.0, 2500.0], p=[0.1, 0.6, 0.2, 0.1])),
        start_deg=float(rng.choice([0.0, 90.0, 180.0], p=[0.6, 0.2, 0.2])),
        directions=("ccw", "cw") if rng.random() < 0.7 else ("cw", "ccw"),
    )
    plan = table_ii_plan(seed, path)
    kind = str(rng.choice(["table-ii", "repeated", "raised", "repeated-raised"], p=[0.35, 0.3, 0.15, 0.2]))
    if "raised" in kind:
        plan = elevated(plan, float(rng.uniform(4.0, 8.0)), list(rng.choice(["abcde", "klmno", "bdhln"])))
    if "repeated" in kind:
        plan = replace(plan, repeat_at_end=("a", "f", "k"))
    return plan, kind


def _noise(rng: np.random.Generator, rate_hz: float) -> Noise:
    white_um = float(rng.uniform(0.2, 0.7))
    if rng.random() < 0.4:
        return Noise(white_um)

    def memory() -> float:
        return float(np.exp(-1.0 / (rate_hz * np.exp(rng.uniform(np.log(0.01), np.log(0.15))))))

    first_um, second_um = float(rng.uniform(0.1, 0.4)), float(rng.uniform(0.05, 0.3))
    return Noise(white_um, first_um, memory(), second_um if rng.random() < 0.5 else 0.0, memory())


def recorded_currents() -> tuple[Mechanism, ...]:
    return (DriveCurrents(),)
