"""Compare measured and predicted circularity per run [GRAV Table 3]."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit.calibrate import residuals
from dbbstation.calibration.reporting.evaluation import LowPassedCircularity
from dbbstation.computing.counted import counting, uncounted
from dbbstation.computing.threads import with_one_thread
from dbbstation.inference.harmonics import smooth_of
from dbbstation.model.machine_model import MachineModel
from dbbstation.trace.analysis import figures_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.computing.counted import Counted
    from dbbstation.model.observation import Observation
    from dbbstation.trace.recording import RawCircle

UNDULATIONS = 30
"""Highest undulations per revolution of form; otherwise the peak-to-valley noise of a bar would hide model errors."""

SAMPLES_PER_UNDULATION = 4


@with_one_thread
def predicted_circles(
    model: MachineModel,
    observations: Sequence[Observation],
    progress: Counted = uncounted,
) -> tuple[LowPassedCircularity, ...]:
    """Compare measured and predicted circularity.

    Raises:
        TraceError: a run that is no circle.
        ModelError: a source needs missing data.
    """
    nominal = residuals(MachineModel(model.machine), observations)
    left = residuals(model.of_the_machine(), observations)
    circles: list[LowPassedCircularity] = []
    for o, before, after in counting(list(zip(observations, nominal, left, strict=True)), progress):
        raw, bar_mm = o.raw, o.raw.circle.bar_mm
        lengths_mm = [raw.length_mm, raw.length_mm - after, bar_mm + before, bar_mm + after]
        circles.append(LowPassedCircularity(*smooth_circularities_um(raw, lengths_mm)))
    return tuple(circles)


def smooth_circularities_um(raw: RawCircle, lengths_mm: Sequence[Floats]) -> list[float]:
    """Return circularities [µm] of lengths, shape (n,) each [mm], at a circle's angles, up to 30 undulations per revolution."""
    return [one.circularity_um for one in figures_of(raw, np.array(_smooth_mm(raw, lengths_mm)))]


def smooth_lengths_mm(raw: RawCircle, length_mm: Floats) -> Floats:
    """Return lengths without undulations above 30 per revolution, shape (n,) [mm]."""
    return _smooth_mm(raw, [length_mm])[0]


def _smooth_mm(raw: RawCircle, lengths_mm: Sequence[Floats]) -> list[Floats]:
    highest = min(UNDULATIONS, max(len(raw) // SAMPLES_PER_UNDULATION, 2))
    bar_mm = raw.circle.bar_mm
    several = smooth_of([length_mm - bar_mm for length_mm in lengths_mm], np.radians(raw.phi_deg), highest)
    return [bar_mm + one for one in several]
