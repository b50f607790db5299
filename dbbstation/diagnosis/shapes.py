"""Errors without a name: any smooth error of strut lengths or readings that some variable organises.

They compete with the named sources. Where one of them explains the recordings clearly better than every source that
has a name, the cause is unknown, and strut and variable are what can be said of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUTS
from dbbstation.machine.kinematics import inverse
from dbbstation.machine.rotation import Frames
from dbbstation.machine.statics import platform_weight, strut_tensions
from dbbstation.sources.contract import Effect

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import Motion

HATS = 7
"""Points of a piecewise linear curve."""

PLAUSIBLE_MM = 0.004
"""Usual size of an unnamed strut-length error, one standard deviation [mm]."""

LOBES = tuple(range(2, 11))
"""Undulations per turn of an unnamed error of the reading that depends on the angle alone."""

WAVES_PER_MM = np.arange(0.0035, 0.26, 0.0015)
"""Waves of strut travel that are looked for: periods of 290 down to 4 mm, spaced so that none is missed over the 300
to 700 mm that a strut travels [1/mm]."""

FINER_PER_MM = (np.linspace(-0.0015, 0.0015, 31), np.linspace(-0.0001, 0.0001, 31))
"""Around each of them and around the best of these, so that a wave keeps its phase to a degree from one end of the
travel to the other [1/mm]."""

STRONGEST = 2
"""Waves of each strut that are kept as shapes."""


@dataclass(frozen=True, eq=False)
class Shape:
    """One family of curves.

    Attributes:
        variable: what the error is a function of, as printed.
        strut: 1 to 6; None where all struts follow the same curve, or where it is no strut's error.
        form: tells apart the variants of one variable, such as a period.
        columns: effect per amplitude at every sample of one run, p amplitudes.
        count: p.
        wave: of strut length [1/mm]; None for what is no wave.
    """

    variable: str
    strut: int | None
    form: str
    columns: Effect
    count: int
    wave: float | None = None


@dataclass(frozen=True, eq=False)
class Ranges:
    """Least and greatest value of each variable over all runs, so that curves have the same points in each."""

    low: dict[str, NDArray[np.float64]]
    high: dict[str, NDArray[np.float64]]


def variables(motion: Motion, machine: Machine) -> dict[str, NDArray[np.float64]]:
    """Return what strut errors may hang on, by name, each of shape (n, 6)."""
    frames = Frames.from_poses(motion.poses, machine.hexapod.rotation)
    struts = inverse(machine.hexapod, frames)
    found = {"strut-length": struts.length_mm}
    if motion.is_path:
        found["strut-speed-sign"] = np.sign(np.gradient(struts.length_mm, axis=0))
    if machine.masses is not None:
        found["strut-force"] = strut_tensions(struts, platform_weight(frames, machine.masses))
    if motion.time_s is not None:
        found["time"] = np.repeat(motion.time_s[:, None], STRUTS, axis=1)
    return found


def ranges(motions: Sequence[Motion], machine: Machine) -> Ranges:
    """Extent of every variable that all motions have."""
    low: dict[str, NDArray[np.float64]] = {}
    high: dict[str, NDArray[np.float64]] = {}
    for motion in motions:
        for name, values in variables(motion, machine).items():
            least, greatest = values[motion.kept].min(axis=0), values[motion.kept].max(axis=0)
            low[name] = np.minimum(low.get(name, least), least)
            high[name] = np.maximum(high.get(name, greatest), greatest)
    return Ranges(low, high)


def strongest_waves(
    residual: Sequence[NDArray[np.float64]],
    per_strut: Sequence[NDArray[np.float64]],
    strut_mm: Sequence[NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Waves of strut length that readings follow best, for each strut, shape (6, 2) [1/mm].

    A first look that leaves the base model alone; the race that follows fits it anew.

    Args:
        residual: per run, shape (n,).
        per_strut: per run, how the reading answers to each strut, shape (n, 6).
        strut_mm: per run, strut lengths, shape (n, 6) [mm].
    """
    rest, gain, length = np.concatenate(residual), np.vstack(per_strut), np.vstack(strut_mm)
    found = np.empty((STRUTS, STRONGEST))
    for i in range(STRUTS):
        weighted = rest * gain[:, i]
        phase = 2.0 * np.pi * np.outer(WAVES_PER_MM, length[:, i])
        power = np.hypot(np.cos(phase) @ weighted, np.sin(phase) @ weighted)
        peaks = np.flatnonzero((power >= np.roll(power, 1)) & (power >= np.roll(power, -1)))
        best = peaks[np.argsort(-power[peaks])][:STRONGEST]
        wave = WAVES_PER_MM[best]
        for finer in FINER_PER_MM:
            near = wave[:, None] + finer
            phase = 2.0 * np.pi * near[:, :, None] * length[:, i]
            power = np.hypot(np.cos(phase) @ weighted, np.sin(phase) @ weighted)
            wave = near[np.arange(len(best)), power.argmax(axis=1)]
        found[i] = np.resize(wave, STRONGEST)
    return found


def shapes(motion: Motion, machine: Machine, extent: Ranges, waves: NDArray[np.float64]) -> list[Shape]:
    """Return all families of curves for one run, in an order that is the same for every run.

    Args:
        motion: the run.
        machine: nominal machine.
        extent: of the variables over all runs.
        waves: of strut length to look at, per strut, shape (6, w) [1/mm].
    """
    values = variables(motion, machine)
    found: list[Shape] = []
    for name in extent.low:
        curves = (
            np.sign(values[name])[:, :, None]
            if name == "strut-speed-sign"
            else hats(values[name], extent.low[name], extent.high[name])
        )
        found += _per_strut(name, "", curves)
    for i in range(STRUTS):
        for wave in waves[i]:
            angle = 2.0 * np.pi * wave * values["strut-length"][:, i]
            own = np.zeros((len(motion), STRUTS, 2))
            own[:, i] = np.column_stack([np.cos(angle), np.sin(angle)])
            found.append(
                Shape("strut-length wave", i + 1, f"period {1.0 / wave:.3f} mm", Effect(strut_mm=own), 2, wave)
            )
    if "time" in extent.low:
        drift = hats(values["time"], extent.low["time"], extent.high["time"])[:, 0]
        found.append(Shape("time of the reading", None, "", Effect(reading_mm=drift), HATS))
    if motion.setup is not None:
        found.append(Shape("place of the platform", None, "", _leaning_table(motion), LEANING))
        theta = _angle_about_ball(motion)
        lobes = np.column_stack([f(k * theta) for k in LOBES for f in (np.cos, np.sin)])
        found.append(Shape("angle", None, "", Effect(reading_mm=lobes), lobes.shape[1]))
    return found


LEANING = 6
"""Each coordinate of the ball, with the platform's X and with its Y."""


def _leaning_table(motion: Motion) -> Effect:
    """A ball on the table that moves with the platform's place, as on a floor that gives way, per 100 mm."""
    moved = np.zeros((len(motion), 3, LEANING))
    for axis in range(3):
        moved[:, axis, 2 * axis : 2 * axis + 2] = motion.poses[:, :2] / 100.0
    return Effect(fixed_ball_mm=moved)


def _angle_about_ball(motion: Motion) -> NDArray[np.float64]:
    """Angle of the commanded tool tip about the fixed ball, from +X towards +Y, shape (n,) [rad]."""
    assert motion.setup is not None  # noqa: S101 - asked by the caller
    away = motion.poses[:, :2] - motion.setup.fixed_ball_mm[:2]
    return np.arctan2(away[:, 1], away[:, 0])


def _per_strut(variable: str, form: str, curves: NDArray[np.float64]) -> list[Shape]:
    """One family per strut from curves of shape (n, 6, p), and one that all struts share."""
    count = curves.shape[2]
    found = []
    for i in range(STRUTS):
        own = np.zeros_like(curves)
        own[:, i] = curves[:, i]
        found.append(Shape(variable, i + 1, form, Effect(strut_mm=own), count))
    found.append(Shape(variable, None, form, Effect(strut_mm=curves), count))
    return found


def hats(values: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.float64]:
    """Piecewise linear curves over each strut's range, shape (n, 6, 7)."""
    span = np.maximum(high - low, 1e-12)
    place = (values - low) / span * (HATS - 1)
    return np.maximum(0.0, 1.0 - np.abs(place[:, :, None] - np.arange(HATS)))
