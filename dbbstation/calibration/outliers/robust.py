"""Detect runs that are no circles of this machine, and balls that moved, one at a time; refit without their influence.

Runs that new physics explains are reinstated.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.checks.scatter import fine_noise_mm
from dbbstation.calibration.outliers.outlier import (
    LEAST_UM,
    STANDS_OUT,
    Outlier,
    OutlierKind,
    left_of,
    rms_um,
    without_shift,
)
from dbbstation.calibration.outliers.stray_balls import ball_moved, off_its_place
from dbbstation.computing.arrays import median_of, place_of_largest
from dbbstation.computing.grouped import grouped
from dbbstation.inference.square_root import chi2_without

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.calibration.outliers.outlier import Fit, Step
    from dbbstation.computing.arrays import Floats
    from dbbstation.model.observation import Observation


FALLS, AT_NOISE = 4.0, 4.0
"""A test is an outlier if its omission reduces the others' mean square by the factor `FALLS`, to less than `AT_NOISE`
times the noise. Missing physics would remain in the other tests."""

ALONE = 1.2
"""A single run is the outlier if its omission leaves at most this multiple of the mean square that remains without the whole test."""


def strange_runs(calibration: Calibration) -> list[int]:
    """Return indices of one test's outlying runs; may be empty."""
    return _strange_test(calibration) or _strange_run(calibration)


def _strange_test(calibration: Calibration) -> list[int]:
    """Return runs of a test whose omission lets all others fit, as indices; may be empty."""
    # Both directions under a wrong test bias the fit, so their own residuals are hardly larger.
    # Per run, because one array of all residuals would need another number per sample.
    squares_um2 = [rms_um(residual) ** 2 for residual in calibration.residual_mm]
    if np.sqrt(np.average(squares_um2, weights=list(map(len, calibration.residual_mm)))) < LEAST_UM:
        return []
    noise = max(fine_noise_mm(calibration), 1e-3 * LEAST_UM / STANDS_OUT)
    known, held = calibration.layout.known, calibration.solution.held
    tests = grouped(((run.setup.session, run.test), k) for k, run in enumerate(calibration.observations))

    counts = np.array([block.count for block in calibration.blocks])

    def misfits(parts: Sequence[Sequence[int]]) -> list[float]:
        chi2 = chi2_without(calibration.blocks, known, noise, held, parts)
        return [one / float(counts.sum() - counts[list(part)].sum()) for one, part in zip(chi2, parts, strict=True)]

    of_all, *each = misfits([[], *tests.values()])
    without = dict(zip(tests, each, strict=True))
    best = min(without, key=without.__getitem__)
    falls = of_all / without[best]
    in_place = falls > FALLS and without[best] < AT_NOISE
    if not (in_place or falls > STANDS_OUT**2):
        return []
    by_run = misfits([[k] for k in tests[best]])
    alone = [k for k, left in zip(tests[best], by_run, strict=True) if left < ALONE * without[best]]
    return alone[:1] or tests[best]


def _strange_run(calibration: Calibration) -> list[int]:
    rest = _rests_um(calibration)
    worst = place_of_largest(rest)
    return [worst] if rest[worst] > _strange_from_um(rest) else []


def _rests_um(calibration: Calibration) -> Floats:
    return np.array([rms_um(without_shift(run, left)) for run, left in left_of(calibration)])


def _strange_from_um(rests_um: Floats) -> float:
    return max(STANDS_OUT * median_of(rests_um), LEAST_UM)


def in_place_after_all(
    calibration: Calibration, runs: Sequence[Observation], outliers: Sequence[Outlier]
) -> tuple[list[Observation], tuple[Outlier, ...]]:
    """Return the runs to fit and the remaining outliers, after new physics entered the model."""

    def named(run: Observation) -> tuple[str, str]:
        return run.setup.session, run.label

    kept = {named(run) for run in calibration.observations}
    limit_um = _strange_from_um(_rests_um(calibration))

    def fits(run: Observation) -> bool:
        left = run.raw.length_mm - calibration.model.bar(run.motion()).length_mm
        return rms_um(without_shift(run, left)) < limit_um

    out = {named(run) for run in runs if named(run) not in kept and not fits(run)}
    labels = {label for _, label in out}
    staying = tuple(o for o in outliers if o.freed or labels & set(o.runs.split(", ")))
    return [run for run in runs if named(run) not in out], staying


def leave_out(fit: Fit, runs: Sequence[Observation], strange: Sequence[int]) -> Step:
    """Fit without some runs of one test, and identify them by this fit."""
    kept = [run for i, run in enumerate(runs) if i not in strange]
    again = fit(kept)
    run = runs[strange[0]]
    residual = run.raw.length_mm - again.model.bar(run.motion()).length_mm
    size = rms_um(residual)
    kind, look = _looks_like(again, kept, run, residual)
    labels = ", ".join(runs[k].label for k in strange)
    text = f"{labels} leaves {size:.1f} µm rms: {look}"
    return Outlier(kind=kind, test=run.test, runs=labels, size_um=size, text=text), kept, again


def _looks_like(
    calibration: Calibration, others: Sequence[Observation], run: Observation, residual: Floats
) -> tuple[OutlierKind, str]:
    noise = _strange_from_um(np.array([rms_um(left) for _, left in left_of(calibration)]))
    best, where = np.inf, run
    for other in others:
        if other.raw.circle == run.raw.circle or other.raw.circle.bar_mm != run.raw.circle.bar_mm:
            continue
        there = other.with_samples(replace(run.raw, circle=other.raw.circle))
        left = run.raw.length_mm - calibration.model.bar(there.motion()).length_mm
        rest = rms_um(without_shift(there, left))
        if rest < best:
            best, where = rest, other
    if best < noise:
        what = f"it is what test {where.test} {where.raw.circle.direction} should read, to {best:.1f} µm"
        why = "the ball stood in that bore, or the run was filed under the wrong test"
        if where.test == run.test:
            why = "was the other direction run?"
        return OutlierKind.WRONG_PLACE, f"{what}; {why}"
    step, at = _step(residual)
    levelled = [part - part.mean() for part in (residual[:at], residual[at:])]
    if rms_um(np.concatenate(levelled)) < 0.5 * rms_um(residual - residual.mean()):
        return (
            OutlierKind.RUN,
            f"the reading steps by {1e3 * step:.1f} µm at {run.raw.theta_deg[at]:.0f}°; bar or holder was bumped",
        )
    return OutlierKind.RUN, "no circle of this machine and no step; a bump, a loose ball, or another machine's run?"


def _step(residual: Floats) -> tuple[float, int]:
    count = len(residual)
    at = np.arange(count // 20 + 1, count - count // 20)
    total = np.cumsum(residual)
    difference = (total[-1] - total[at - 1]) / (count - at) - total[at - 1] / at
    weight = np.sqrt(at * (count - at))
    k = place_of_largest(np.abs(difference) * weight)
    return float(difference[k]), int(at[k])


MOST = 8
"""Most outliers; more indicate another machine or plan."""


def calibrate_robust(
    fit: Fit,
    observations: Sequence[Observation],
    *,
    balls: bool = True,
) -> tuple[Calibration, tuple[Outlier, ...]]:
    """Fit, and refit after each detected outlier.

    Raises:
        CalibrationError: as raised by `fit`.
    """
    calibration = fit(list(observations))
    runs = list(calibration.observations)
    found: list[Outlier] = []
    while len(found) < MOST:
        step = _next(fit, calibration, runs, balls=balls)
        if step is None:
            break
        outlier, runs, calibration = step
        found.append(outlier)
    return calibration, tuple(found)


def _next(fit: Fit, calibration: Calibration, runs: Sequence[Observation], *, balls: bool) -> Step | None:
    strange = strange_runs(calibration)
    if strange:
        return leave_out(fit, runs, strange)
    if not balls:
        return None
    return ball_moved(fit, calibration, runs) or off_its_place(fit, calibration, runs)
