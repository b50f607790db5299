"""Locate a misfit by test, direction, angle and strut."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.findings import Location
from dbbstation.diagnosis.parts import SESSION_TIME
from dbbstation.inference.blocks import runs_of
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.harmonics import smooth
from dbbstation.inference.left_over import COUNTS_SIGMA
from dbbstation.model.machine_model import MachineModel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.diagnosis.explained import SettledCircles
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
    model = calibration.model
    contributions: list[Floats | None] = []
    for observation in calibration.observations:
        motion = observation.motion()
        reading = model.bar(motion)
        effect = MachineModel(model.machine, tuple(fitted)).effect(motion, reading.actual)
        if effect.strut_mm is None:
            contributions.append(None)
            continue
        lengths = np.broadcast_to(effect.strut_mm, (len(motion), 6))
        contributions.append((reading.sensitivity.response.per_strut * lengths)[motion.kept])
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
