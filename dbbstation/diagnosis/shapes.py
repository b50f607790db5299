"""Curves of unmodelled effects on struts, readings or balls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline

from dbbstation.inference.forms import (
    BehindReversal,
    Form,
    LinearSplines,
    Lobes,
    Plane,
    Proportional,
    SignForm,
    Spring,
    Walk,
    Wave,
)
from dbbstation.inference.triangle import products_of_rows
from dbbstation.machine.geometry import STRUT_NUMBERS, STRUTS
from dbbstation.machine.statics import Load, platform_weight, strut_tensions
from dbbstation.sources.contract import Effect
from dbbstation.sources.laws.motion import since_turning
from dbbstation.sources.laws.temperature import FOLLOWED_K, known_thermometers, logged_degc
from dbbstation.text.written import words

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Frames, Machine
    from dbbstation.machine.kinematics import Struts
    from dbbstation.model.machine_model import BarReading
    from dbbstation.sources.contract import Motion

PLAUSIBLE_MM = 0.004
"""Usual size of an unnamed error, one standard deviation [mm]."""

LOBES = tuple(range(2, 11))
"""Undulations per turn of an arbitrary reading error over the angle."""

LEVER_MM = 100.0
"""Lever arm that converts rotations and moments [mm]."""

EVERY, SIGNED = "every strut", "every strut by direction of travel"
READING, BALL, TABLE, TOOL = "reading", "ball on the table", "table", "ball on the tool"
PULL, TOWARDS = "pull", "pull towards a place"
"""Parts that an effect moves: struts; struts with a sign by direction; the reading; a ball; the table with the ball;
struts through a pull on the platform, in any direction or towards a place."""

WAYS_DEG = tuple(30.0 * k for k in range(12))
"""Tried directions of the pulling place. Height, distance and point of attack are not searched: the nearest form leaves
14 to 40 % of a hose's effect that joints do not absorb (rms, seven hoses of 0.7 to 2 m; docs/decisions.md, 20)."""

STICKING_MM = 0.04
"""Travel of sticking after a reversal, in one or several jerks: presliding and stick-slip take micrometres to tens of
micrometres [Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083, sec. 2.2] [mm]."""

STICKING_HALVES = 5
"""Points of this curve; a circle has two or three samples on this travel."""

AWAY_MM = 1000.0
"""Distance of the pulling place from the Z axis, beyond the machine's frame."""

UNITS = {
    "strut-length": "mm",
    "strut-force": "N",
    "strut-speed-sign": "sign",
    "strut-speed": "mm/s",
    "strut-acceleration": "mm/s²",
    "time since its reversal": "s",
    "travel since its reversal": "mm",
    "time": "s",
    "strut-temperature": "degC",
    "machine-temperature": "degC",
    "jig-temperature": "degC",
    "bar-temperature": "degC",
    "angle": "deg",
    "angle since the start": "turns",
    "position of the platform": "mm",
    "tilt of the platform": "deg",
    "position of the platform towards a place": "mm",
}
"""Variables that an error may follow, and their units."""

TEMPERATURES = tuple(name for name, unit in UNITS.items() if unit == "degC")
"""Variables logged by thermometers."""

OF_STRUTS = words(
    "strut-length, strut-force, strut-speed-sign, strut-speed, "
    "strut-acceleration, time since its reversal, travel since its reversal, strut-temperature"
)
"""Variables with separate values for each strut."""

THERMOMETERS = ("machine", "jig", "bar")
"""Thermometers not on struts, by column name."""


@dataclass(frozen=True, eq=False)
class Samples:
    """One run's kept rows, for shapes.

    Attributes:
        values: by variable, shape (n,), (n, 6) by strut, or (n, c).
        gain: sensitivity of the reading to each moved part, shape (n, d); (n, 6) for struts.
    """

    values: dict[str, Floats]
    gain: dict[str, Floats]


@dataclass(frozen=True)
class Follows:
    """The variable of an unmodelled error, and the part that it moves.

    Attributes:
        kind: such as `wave`; empty for the usual one.
    """

    variable: str
    kind: str = ""
    moves: str = EVERY

    def __str__(self) -> str:
        """Return variable, kind and moved part, as printed."""
        kind = f" {self.kind}" if self.kind else ""
        own = (self.variable, self.moves) in ITS_OWN
        return f"{self.variable}{kind}{'' if own else BEHIND.get(self.moves, '')}"

    @property
    def moves_struts(self) -> bool:
        """Return whether it moves struts."""
        return self.moves in {EVERY, SIGNED}


@dataclass(frozen=True, eq=False)
class Shape:
    """One family of curves.

    Attributes:
        kind: such as `wave`; empty for the usual one.
        strut: 1 to 6; None for all or none.
        moves: moved part; a strut restricts it.
        tried: number of independent forms from which it was picked.
    """

    variable: str
    kind: str
    strut: int | None
    moves: str
    form: Form
    tried: float = 1.0
    explained: float = 0.0

    @property
    def follows(self) -> Follows:
        """Return its variable and moved part."""
        return Follows(self.variable, self.kind, self.moves)

    @property
    def period(self) -> float | None:
        """Return a wave's period in the variable's unit, else None."""
        return 1.0 / self.form.frequency if isinstance(self.form, Wave) else None

    def columns(self, samples: Samples) -> Floats:
        """Return effects of amplitudes on readings: directions times curves, shape (n, d p)."""
        values, gain = self.followed(samples.values[self.variable]), self._gain(samples)
        if self.variable not in OF_STRUTS or self.strut is not None:
            curve = self.form.columns(values)
            return products_of_rows(gain, curve)
        return np.einsum("ni,nip->np", samples.gain[self.moves], self.form.columns(values))

    def by_strut(self, samples: Samples, amplitudes: Floats) -> tuple[Floats, int]:
        """Return each strut's contribution to readings, shape (n, 6), and its number of amplitudes."""
        gain, values = samples.gain[self.moves], self.followed(samples.values[self.variable])
        columns = self.form.columns(values)
        count = columns.shape[-1]
        curve = columns @ amplitudes[:count]
        effect = gain * (curve[:, None] if curve.ndim == 1 else curve)
        return effect * (np.array(STRUT_NUMBERS) == self.strut) if self.strut else effect, count

    def followed(self, values: Floats) -> Floats:
        """Return its variable's values, by strut or place."""
        if isinstance(self.form, Spring):
            return values[..., WAYS_DEG.index(self.form.towards_deg)]
        return values[..., self.strut - 1] if self.variable in OF_STRUTS and self.strut else values

    def _gain(self, samples: Samples) -> Floats:
        gain = samples.gain[self.moves]
        if isinstance(self.form, Spring):
            gain = np.split(gain, len(WAYS_DEG), axis=1)[WAYS_DEG.index(self.form.towards_deg)]
        if self.strut is not None:
            return gain[:, self.strut - 1 : self.strut]
        return gain.sum(axis=1, keepdims=True) if self.moves in {EVERY, SIGNED} else gain


BEHIND = {
    SIGNED: " by direction of travel",
    READING: " of the reading",
    BALL: " of the ball on the table",
    TABLE: " of the table",
    TOOL: " of the ball on the tool",
    PULL: " with a pull on it",
    TOWARDS: " that pulls on it",
}
"""Endings of printed names, by moved part; empty for struts."""

ITS_OWN = {
    ("angle", READING),
    ("position of the platform", BALL),
    ("tilt of the platform", TOOL),
}
"""Variables that imply the moved part."""


@dataclass(frozen=True, eq=False)
class Ranges:
    """Extents of variables over all runs."""

    low: dict[str, Floats]
    high: dict[str, Floats]

    def of(self, name: str, strut: int | None = None) -> tuple[float, float]:
        """Return the limits of a variable, or of one strut's."""
        low, high = (each[name] if strut is None else each[name][strut - 1] for each in (self.low, self.high))
        return float(low), float(high)


def variables(motion: Motion, machine: Machine) -> dict[str, Floats]:
    """Return variables of all rows: shape (n, 6) by strut, else (n,) or (n, c)."""
    struts = motion.struts(machine)
    found = {"strut-length": struts.length_mm}
    if motion.is_path:
        # Speed over the last step, as in play; a row with wrong sign near a turn would look like an effect.
        steps = np.diff(struts.length_mm, axis=0)
        found["strut-speed-sign"] = np.sign(np.concatenate([steps[:1], steps]))
        found["travel since its reversal"] = since_turning(struts.length_mm)
    if machine.masses is not None:
        found["strut-force"] = strut_tensions(struts, platform_weight(motion.frames(machine), machine.masses))
    if motion.time_s is not None:
        found["time"] = motion.time_s
        if motion.is_path and np.all(np.diff(motion.time_s) > 0.0):
            # A spline, because differences are worst at the ends of a run, the only part that joints do not absorb.
            path = CubicSpline(motion.time_s, struts.length_mm)
            found["strut-speed"], found["strut-acceleration"] = path(motion.time_s, 1), path(motion.time_s, 2)
            found["time since its reversal"] = _since_reversal_s(motion.time_s, found["strut-speed"])
    found |= _temperatures(motion)
    found["position of the platform"] = motion.poses[:, :2]
    found["tilt of the platform"] = motion.poses[:, 3:5]
    found["position of the platform towards a place"] = np.linalg.norm(_hoses(motion.frames(machine), machine), axis=2)
    if motion.setup is not None:
        away = motion.poses[:, :2] - motion.setup.fixed_ball_mm[:2]
        angle = np.unwrap(np.arctan2(away[:, 1], away[:, 0]))
        found["angle"] = np.mod(np.degrees(angle), 360.0)
        found["angle since the start"] = (angle - angle[motion.kept][0]) / (2.0 * np.pi)
    return found


def _since_reversal_s(time_s: Floats, speed_mm_s: Floats) -> Floats:
    """Return time since each strut's reversal with its new sign; zero before, shape (n, 6) [s]."""
    # The time of reversal is interpolated at zero speed.
    since = np.zeros_like(speed_mm_s)
    for strut in range(speed_mm_s.shape[1]):
        speed = speed_mm_s[:, strut]
        turns = np.flatnonzero(speed[:-1] * speed[1:] < 0.0)
        for k, stop in zip(turns, [*(turns[1:] + 1), len(speed)], strict=True):
            turned_s = time_s[k] + (time_s[k + 1] - time_s[k]) * speed[k] / (speed[k] - speed[k + 1])
            since[k + 1 : stop, strut] = np.sign(speed[k + 1]) * (time_s[k + 1 : stop] - turned_s)
    return since


def _temperatures(motion: Motion) -> dict[str, Floats]:
    logged = known_thermometers(motion)
    found = {f"{name}-temperature": logged_degc(motion, name)[0] for name in THERMOMETERS if name in logged}
    on_struts = [f"strut{strut}" for strut in STRUT_NUMBERS]
    if all(name in logged for name in on_struts):
        found["strut-temperature"] = np.column_stack([logged_degc(motion, name)[0] for name in on_struts])
    return found


def samples_of(
    every: Mapping[str, Floats], motion: Motion, machine: Machine, reading: BarReading, pivot_mm: Floats | None = None
) -> Samples:
    """Return variables and gains of a run.

    Args:
        every: `variables` of the motion.
        pivot_mm: of table rotation, shape (3,); None for no rotation.
    """
    known = {name: values[motion.kept] for name, values in every.items()}
    gain = {
        EVERY: reading.by_parameters(Effect(strut_mm=np.eye(STRUTS))),
        READING: np.ones((len(reading.length_mm), 1)),
        BALL: reading.by_parameters(Effect(fixed_ball_mm=np.eye(3))),
        TOOL: reading.by_parameters(Effect(tool_tip_mm=np.eye(3))),
        PULL: reading.by_parameters(Effect(strut_mm=_pulled(motion.struts(machine)))),
        TOWARDS: reading.by_parameters(Effect(strut_mm=_pulled_towards(motion, machine))),
    }
    if motion.is_path:
        gain[SIGNED] = gain[EVERY] * known["strut-speed-sign"]
    if motion.setup is not None and pivot_mm is not None:
        # A small rotation w moves the ball by w x arm.
        turns = np.cross(np.eye(3), (motion.setup.fixed_ball_mm - pivot_mm) / LEVER_MM).T
        gain[TABLE] = np.hstack([gain[BALL], gain[BALL] @ turns])
    return Samples(known, gain)


def _pulled(struts: Struts) -> Floats:
    count = len(struts.length_mm)
    stretch = np.empty((count, STRUTS, 6))
    for k, load in enumerate(np.diag([1.0] * 3 + [LEVER_MM] * 3)):
        wrench = np.tile(load, (count, 1))
        stretch[:, :, k] = strut_tensions(struts, Load(wrench[:, :3], wrench[:, 3:]))
    return stretch


def _hoses(frames: Frames, machine: Machine) -> Floats:
    """Return vectors from the platform's middle to the pulling places, shape (n, 12, 3) [mm]."""
    middle = frames.position_mm + frames.rotation @ machine.hexapod.platform_joints_mm.mean(axis=0)
    angles = np.radians(WAYS_DEG)
    places = AWAY_MM * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
    places[:, 2] = middle[:, 2].mean()
    return places - middle[:, None, :]


def _pulled_towards(motion: Motion, machine: Machine) -> Floats:
    """Return the struts' stretch by unit pulls, shape (n, 6, 60): five parameters per place."""
    # The parameters are the pull at the platform's middle, moments at `LEVER_MM` about its axes, and a downward force
    # for unknown height.
    struts, frames = motion.struts(machine), motion.frames(machine)
    count = len(motion)
    hoses, still = _hoses(frames, machine), np.zeros((count, 3))
    arm = frames.rotation @ machine.hexapod.platform_joints_mm.mean(axis=0)
    down = strut_tensions(struts, Load(np.tile([0.0, 0.0, -1.0], (count, 1)), np.cross(arm, [0.0, 0.0, -1.0])))
    found = []
    for way in range(len(WAYS_DEG)):
        pull = hoses[:, way] / np.linalg.norm(hoses[:, way], axis=1, keepdims=True)
        moments = [np.cross(LEVER_MM * frames.rotation[:, :, axis], pull) for axis in range(3)]
        loads = [Load(pull, np.cross(arm, pull)), *(Load(still, moment) for moment in moments)]
        found += [*(strut_tensions(struts, load) for load in loads), down]
    return np.stack(found, axis=2)


def ranges(runs: Sequence[Samples]) -> Ranges:
    """Return extents of variables that all runs have."""
    names = [name for name in runs[0].values if all(name in run.values for run in runs)]
    low = {name: np.min([run.values[name].min(axis=0) for run in runs], axis=0) for name in names}
    high = {name: np.max([run.values[name].max(axis=0) for run in runs], axis=0) for name in names}
    return Ranges(low, high)


def shapes(extent: Ranges) -> list[Shape]:
    """Return families that need no search, in order of columns."""
    found: list[Shape] = []
    warmed = [n for n in extent.low if n in TEMPERATURES and np.max(extent.high[n] - extent.low[n]) > FOLLOWED_K]
    usual = ("strut-length", "strut-force", "strut-speed-sign", "strut-speed", "strut-acceleration", "time")
    for name in (*usual, *warmed):
        if name not in extent.low:
            continue
        found += [Shape(name, "", strut, EVERY, _usual(name, extent, strut)) for strut in (*STRUT_NUMBERS, None)]
    if "strut-speed-sign" in extent.low:
        found += [
            Shape("strut-length", "", strut, SIGNED, _usual("strut-length", extent, strut)) for strut in STRUT_NUMBERS
        ]
        behind = BehindReversal(STICKING_MM, STICKING_HALVES)
        found += [Shape("travel since its reversal", "", strut, EVERY, behind) for strut in STRUT_NUMBERS]
    for name in ("time", *warmed):
        if name in extent.low and name not in OF_STRUTS:
            found += [Shape(name, "", None, moves, _usual(name, extent, None)) for moves in (READING, BALL)]
    found.append(Shape("position of the platform", "", None, BALL, Plane(100.0, 2)))
    found.append(Shape("position of the platform", "", None, TABLE, Plane(100.0, 2)))
    found.append(Shape("tilt of the platform", "", None, TOOL, Plane(10.0, 2)))
    found.append(Shape("position of the platform", "", None, PULL, Plane(100.0, 2, constant=True)))
    found += [
        Shape(
            "position of the platform towards a place",
            "",
            None,
            TOWARDS,
            Spring(way, AWAY_MM),
            tried=float(len(WAYS_DEG)),
        )
        for way in WAYS_DEG
    ]
    if "angle" in extent.low:
        found.append(Shape("angle", "", None, READING, Lobes(LOBES)))
        turned = LinearSplines(extent.low["angle since the start"], extent.high["angle since the start"])
        found.append(Shape("angle since the start", "", None, READING, turned))
    return found


def wander(runs: Sequence[Samples]) -> list[Shape]:
    """Return a random walk of the reading over time; empty without times."""
    times = [run.values["time"] for run in runs if "time" in run.values]
    if len(times) < len(runs):
        return []
    at = np.unique(np.concatenate([np.linspace(one.min(), one.max(), WALK_STEPS + 1) for one in times]))
    return [Shape("time", "wander", None, READING, Walk(at, 60.0))]


WALK_STEPS = 6
"""Linear pieces of a random walk per run; faster changes count as noise."""


def _usual(name: str, extent: Ranges, strut: int | None) -> Form:
    low, high = extent.low[name], extent.high[name]
    if name == "strut-speed-sign":
        return SignForm()
    if name in {"strut-speed", "strut-acceleration"}:
        return Proportional(float(np.max(np.abs([low, high]))))
    if name in OF_STRUTS and strut is not None:
        return LinearSplines(low[strut - 1], high[strut - 1])
    # A common curve: equal length or force has equal effect on each strut.
    return LinearSplines(low.min(), high.max())
