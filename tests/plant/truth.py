"""What a simulated session is really made of: for the examiner, never for the examined."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.plant.files import plan_text
from tests.plant.mechanisms.balls import BallCoordinates, MountingShifts
from tests.plant.mechanisms.bar import BarOffset
from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.rotation import angles_of
from tests.plant.run import Motion, Scene, Slot
from tests.plant.simulate import true_platform

if TYPE_CHECKING:
    from pathlib import Path as FilePath

    from tests.plant.arrays import BoolArray, FloatArray
    from tests.plant.machine import Machine
    from tests.plant.mechanisms.base import Mechanism
    from tests.plant.noise import Noise


@dataclass(frozen=True)
class TrueRun:
    """One run without noise: sample times [s], commanded angles [deg], lengths [mm], all `(n,)`."""

    slot: Slot
    time_s: FloatArray
    theta_deg: FloatArray
    in_circle: BoolArray
    length_mm: FloatArray


@dataclass(frozen=True)
class Truth:
    """Every error of a session, with every random draw."""

    seed: int
    folder: FilePath
    scene: Scene
    mechanisms: tuple[Mechanism, ...]
    noise: Noise
    runs: tuple[TrueRun, ...]

    @property
    def nominal(self) -> Machine:
        return self.scene.machine

    @property
    def delta_length_mm(self) -> FloatArray:
        """Reference length errors `(6,)`, actual minus believed."""
        return sum((item.length_mm for item in self._kinematics()), start=np.zeros(6))

    @property
    def delta_base_mm(self) -> FloatArray:
        """Base joint errors `(6, 3)`, actual minus nominal."""
        return sum((item.base_mm for item in self._kinematics()), start=np.zeros((6, 3)))

    @property
    def delta_platform_mm(self) -> FloatArray:
        """Platform joint errors `(6, 3)`, actual minus nominal."""
        return sum((item.platform_mm for item in self._kinematics()), start=np.zeros((6, 3)))

    @property
    def mounting_shift_um(self) -> dict[int, FloatArray]:
        """Shift `(3,)` of the ball at each mounting, jig frame; usual scatter and bad seating together."""
        shifts = [item.shift_um for item in self.mechanisms if isinstance(item, MountingShifts)]
        return {
            slot.mounting: sum((np.asarray(shift.get(slot.mounting, 0.0)) for shift in shifts), start=np.zeros(3))
            for slot in self.scene.slots
        }

    @property
    def ball_error_um(self) -> dict[str, FloatArray]:
        """Error `(3,)` of each entry of the CMM sheet, true minus printed, jig frame."""
        errors = [item.error_um for item in self.mechanisms if isinstance(item, BallCoordinates)]
        return {
            ball.name: sum((np.asarray(error.get(ball.name, 0.0)) for error in errors), start=np.zeros(3))
            for ball in self.scene.plan.balls
        }

    @property
    def bar_offset_um(self) -> float:
        return sum(item.offset_um for item in self.mechanisms if isinstance(item, BarOffset))

    def actual_pose(self, poses: FloatArray, session_s: float | FloatArray = 0.0) -> FloatArray:
        """Actual poses `(n, 6)` [mm, deg] for commanded ones, taken as a path in this order at session times [s].

        With one common time the thermal state is that of this time; effects that need speeds then have none to act on.
        """
        platform = true_platform(self._motion(poses, session_s), self.mechanisms)
        angles_deg = angles_of(platform.rotation, self.nominal.rotation)
        return np.concatenate([platform.position_mm, angles_deg], axis=1)

    def tensions_n(self, poses: FloatArray) -> FloatArray:
        """True strut tensions [N] `(n, 6)` at commanded poses, positive where a strut pulls towards the base."""
        return true_platform(self._motion(poses, 0.0), self.mechanisms).tension_n

    def run(self, test: str, direction: str, repeat: int = 1) -> TrueRun:
        sought = f"{test}-{direction}-{repeat}"
        return next(run for run in self.runs if run.slot.stem == sought)

    def noise_free_lengths(self, test: str, direction: str, repeat: int = 1) -> tuple[FloatArray, FloatArray]:
        """Commanded angles [deg] and true readings [mm] `(n,)` on the 360 degrees of data, in time order."""
        run = self.run(test, direction, repeat)
        return run.theta_deg[run.in_circle], run.length_mm[run.in_circle]

    def as_dict(self) -> dict[str, Any]:
        return {
            "seed": self.seed,
            "session": self.folder.name,
            "delta_length_mm": self.delta_length_mm.tolist(),
            "delta_base_mm": self.delta_base_mm.tolist(),
            "delta_platform_mm": self.delta_platform_mm.tolist(),
            "mounting_shift_um": {key: value.tolist() for key, value in self.mounting_shift_um.items()},
            "ball_error_um": {key: value.tolist() for key, value in self.ball_error_um.items()},
            "bar_offset_um": self.bar_offset_um,
            "mechanisms": [
                {"name": item.name, "listed": item.listed, "parameters": item.parameters()} for item in self.mechanisms
            ],
            "noise_um": {"white": self.noise.white_um, "correlated": self.noise.correlated_um},
            "plan": plan_text(self.scene.plan),
        }

    def write(self, file: FilePath) -> None:
        if file.resolve().is_relative_to(self.folder.resolve()):
            raise ValueError(f"{file} lies inside the session: the answer belongs elsewhere")
        file.write_text(json.dumps(self.as_dict(), indent=1, default=plain) + "\n", encoding="utf-8")

    def _kinematics(self) -> list[Kinematics]:
        return [item for item in self.mechanisms if isinstance(item, Kinematics)]

    def _motion(self, poses: FloatArray, session_s: float | FloatArray) -> Motion:
        return Motion(self.scene, np.broadcast_to(np.asarray(session_s, dtype=float), len(poses)), poses)


def plain(value: object) -> object:
    if isinstance(value, (np.ndarray, np.floating, np.integer, np.bool_)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no place in an answer")
