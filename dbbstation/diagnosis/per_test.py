"""Gain of each test by named causes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.calibration.reporting.evaluation import rms_um
from dbbstation.calibration.reporting.residual_map import names_of_tests
from dbbstation.diagnosis.drawn import GainOfTest, Trace
from dbbstation.inference.bounds import BOUNDS
from dbbstation.trace.analysis import figures
from dbbstation.trace.recording import by_angle

if TYPE_CHECKING:
    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.diagnosis.findings import Diagnosis


def gains_by_test(diagnosis: Diagnosis) -> tuple[GainOfTest, ...]:
    """Return every test's gain, in recording order."""
    before, after = diagnosis.before, diagnosis.after
    rounds = [_circularity_um(before), _circularity_um(after)]
    names = names_of_tests(before.observations)
    rows: dict[str, list[int]] = {}
    for k, name in enumerate(names):
        rows.setdefault(name, []).append(k)
    return tuple(
        GainOfTest(
            name=name,
            residual_um=(
                rms_um([before.residual_mm[k] for k in own]),
                rms_um([after.residual_mm[k] for k in own]),
            ),
            circularity_um=(max(rounds[0][k] for k in own), max(rounds[1][k] for k in own)),
            traces=tuple(_trace(diagnosis, k) for k in own),
        )
        for name, own in rows.items()
    )


def _circularity_um(calibration: Calibration) -> list[float]:
    return [
        figures(o.raw, o.raw.circle.bar_mm + left).circularity_um
        for o, left in zip(calibration.observations, calibration.residual_mm, strict=True)
    ]


def _trace(diagnosis: Diagnosis, k: int) -> Trace:
    raw = diagnosis.before.observations[k].raw
    measured = 1e3 * (raw.length_mm - raw.circle.bar_mm)
    predicted = [measured - 1e3 * fit.residual_mm[k] for fit in (diagnosis.before, diagnosis.after)]
    theta, curves = by_angle(raw, [*predicted, measured], BOUNDS.trace_points)
    return Trace(raw.circle.direction, theta, *curves)
