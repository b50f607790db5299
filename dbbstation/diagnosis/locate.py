"""Locate a misfit by test, direction, angle and strut, and a strut whose residual grows after its reversals."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import fdtrc

from dbbstation.diagnosis.findings import Location
from dbbstation.diagnosis.parts import SESSION_TIME, through_struts
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.harmonics import smooth
from dbbstation.inference.left_over import COUNTS_SIGMA
from dbbstation.inference.square_root import runs_of
from dbbstation.inference.triangle import root
from dbbstation.machine.geometry import STRUT_NUMBERS, STRUTS
from dbbstation.model.machine_model import MachineModel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.diagnosis.explain import SettledCircles
    from dbbstation.diagnosis.shapes import Samples
    from dbbstation.inference.harmonics import Misfit
    from dbbstation.inference.levels import Levels
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import Fitted


def locations_of(before: Calibration, settled: SettledCircles, first: Misfit, levels: Levels) -> tuple[Location, ...]:
    """Return the largest misfits of the base, the variable of the largest class, and the struts of all classes."""
    names = {member.name for member in settled.members}
    fitted = [f for f in settled.after.model.sources if f.source.name in names]
    largest = max(levels.follows, key=lambda one: one.rms, default=None)
    variable = "" if largest is None or largest.in_time else largest.variables[0][0]
    variable = "time" if variable == SESSION_TIME else variable
    none: list[Floats | None] = [None] * len(before.observations)
    struts = strut_contributions(before, fitted) if fitted else none
    return locate(before.observations, before.residual_mm, first.noise, _with_unmodelled(settled, struts), variable)


def _with_unmodelled(settled: SettledCircles, struts: list[Floats | None]) -> list[Floats | None]:
    """Add struts' unmodelled contributions to readings, shape (n, 6) [mm] per run."""
    unmodelled, members = settled.unmodelled, settled.best.members
    for member, own, _ in settled.comparison.estimated(members):
        shapes = [one for one in unmodelled.of(member) if one.follows.moves_struts]
        for k, run in enumerate(unmodelled.runs):
            rest = own[: member.width]
            for shape in shapes:
                effect, count = shape.by_strut(run, rest)
                rest, before = rest[count:], struts[k]
                struts[k] = effect if before is None else before + effect
    return struts


def locate(
    observations: Sequence[Observation],
    residual_mm: Sequence[Floats],
    noise_mm: float,
    struts: Sequence[Floats | None],
    variable: str,
) -> tuple[Location, ...]:
    """Return stretches beyond noise, largest share first."""
    smoothed = [smooth(r, np.radians(o.raw.phi_deg)) for o, r in zip(observations, residual_mm, strict=True)]
    total = sum(float(s @ s) for s in smoothed)
    found: list[Location] = []
    for observation, curve, strut in zip(observations, smoothed, struts, strict=True):
        # A low-pass at harmonic 30 leaves 61 degrees of freedom.
        threshold = COUNTS_SIGMA * noise_mm * np.sqrt(61.0 / len(curve))
        for start, stop in _stretches(np.abs(curve) > threshold):
            rows = np.arange(start, stop) % len(curve)
            theta = observation.raw.theta_deg[rows[[0, -1]]]
            ends = (float(theta[0]), float(theta[1]))
            found.append(
                Location(
                    test=observation.test,
                    direction=str(observation.raw.circle.direction),
                    theta_deg=ends if observation.raw.circle.direction.sign > 0 else ends[::-1],
                    strut=_strut(strut, rows),
                    variable=variable,
                    share=float(curve[rows] @ curve[rows]) / total,
                    peak_um=1e3 * float(curve[rows][np.argmax(np.abs(curve[rows]))]),
                )
            )
    found.sort(key=lambda location: -location.share)
    return tuple(found[: BOUNDS.locations])


def strut_contributions(calibration: Calibration, fitted: Sequence[Fitted]) -> list[Floats | None]:
    """Return struts' contributions to readings per run, shape (n, 6) [mm]."""
    contributions = []
    for motion in (observation.motion() for observation in calibration.observations):
        reading = calibration.model.bar(motion)
        effect = MachineModel(calibration.model.machine, tuple(fitted)).effect(motion, reading.actual)
        contributions.append(through_struts(effect, motion, reading))
    return contributions


def _strut(contribution: Floats | None, rows: Integers) -> int | None:
    if contribution is None:
        return None
    return 1 + int(np.argmax(np.sum(contribution[rows] ** 2, axis=0)))


def _stretches(marked: Flags) -> list[tuple[int, int]]:
    """Return start and end of marked stretches on a closed turn; ends may exceed its length."""
    if marked.all():
        return [(0, len(marked))]
    if not marked.any():
        return []
    shift = int(np.argmin(marked))
    return [(rows.start + shift, rows.stop + shift) for rows in runs_of(np.roll(marked, -shift))]


FEWEST = 8
"""Fewest stretches of each kind for a comparison of mean squares."""


@dataclass(frozen=True)
class Louder:
    """Mean squares in some stretches, compared with other stretches."""

    probability: float
    rms: float
    elsewhere: float

    @property
    def beyond(self) -> float:
        """Return the stretches' excess rms, in the residual's unit."""
        return root(self.rms**2 - self.elsewhere**2)


def louder(residuals: Sequence[Floats], begins: Sequence[Integers], length: int) -> Louder | None:
    """Compare the stretches that begin at given rows with other stretches of equal length; None for too few.

    Correlated mean squares have 2 mean² / variance degrees of freedom [Satterthwaite, Biometrics Bulletin 2 (1946) 110].

    Args:
        begins: first rows of stretches per run, unordered.
    """
    inside, outside = [], []
    for residual, rows in zip(residuals, begins, strict=True):
        squares, taken = residual**2, np.zeros(len(residual), dtype=bool)
        for row in rows.tolist():
            own = slice(row, row + length)
            # A stretch that overlaps the previous one is not counted.
            if row + length <= len(residual) and not taken[own].any():
                inside.append(float(squares[own].mean()))
            taken[own] = True
        starts = range(0, len(residual) - length + 1, length)
        outside += [float(squares[k : k + length].mean()) for k in starts if not taken[k : k + length].any()]
    if min(len(inside), len(outside)) < FEWEST:
        return None
    there, elsewhere = float(np.mean(inside)), float(np.mean(outside))
    spread = float(np.var(outside, ddof=1))
    if not (elsewhere > 0.0 and spread > 0.0):
        return None
    each = 2.0 * elsewhere**2 / spread
    chance = float(fdtrc(each * len(inside), each * len(outside), there / elsewhere))
    return Louder(chance, float(np.sqrt(there)), float(np.sqrt(elsewhere)))


WITHIN_S = (0.5, 1.0, 2.0, 4.0)
"""Tested times after a reversal [s]: usual durations of oscillations of a drive's control or mounting."""

FEWEST_ROWS = 4
"""Fewest samples of such a stretch: two samples cannot distinguish an oscillation from noise."""


@dataclass(frozen=True)
class AfterReversals:
    """The residual after one strut's reversals.

    Attributes:
        strut: 1 to 6.
        louder: sizes [mm], and the probability under uniform noise, over all struts and times.
    """

    strut: int
    within_s: float
    louder: Louder

    @property
    def text(self) -> str:
        """Return the finding in two sentences."""
        there_um, elsewhere_um = 1e3 * self.louder.rms, 1e3 * self.louder.elsewhere
        return (
            f"The residual is larger just after strut {self.strut} turns round: {there_um:.2g} µm rms within {self.within_s:g} s, "
            f"{elsewhere_um:.2g} µm elsewhere. A strut that rings does that; noise that is the same everywhere does not."
        )


def after_reversals(runs: Sequence[Samples], residual_mm: Sequence[Floats]) -> AfterReversals | None:
    """Return the strut with the largest residual after reversals; None for too few samples."""
    if not all({"time", "strut-speed-sign"} <= run.values.keys() for run in runs):
        return None
    apart_s = float(np.median(np.concatenate([np.diff(run.values["time"]) for run in runs])))
    found: list[AfterReversals] = []
    lengths = [(within_s, round(within_s / apart_s)) for within_s in WITHIN_S]
    lengths = [(within_s, rows) for within_s, rows in lengths if rows >= FEWEST_ROWS]
    for strut in STRUT_NUMBERS:
        begins = [_reversals(run.values["strut-speed-sign"][:, strut - 1]) for run in runs]
        for within_s, rows in lengths:
            one = louder(residual_mm, begins, rows)
            if one is not None:
                chance = min(1.0, one.probability * STRUTS * len(lengths))
                found.append(AfterReversals(strut, within_s, replace(one, probability=chance)))
    return min(found, key=lambda one: (one.louder.probability, -one.louder.beyond), default=None)


def _reversals(sign: Floats) -> Integers:
    moving = np.flatnonzero(sign)
    return moving[1:][np.diff(sign[moving]) != 0.0]
