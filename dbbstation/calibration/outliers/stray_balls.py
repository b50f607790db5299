"""Detect and free displaced balls and bars of wrong length."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri, ndtr

from dbbstation.calibration.checks.scatter import UNKNOWN_MM, MountingOffset, seats_of
from dbbstation.calibration.outliers.outlier import LEAST_UM, STANDS_OUT, Outlier, OutlierKind, left_of, shift_of
from dbbstation.computing.arrays import hypot_of, median_of, place_of_largest
from dbbstation.errors import CalibrationError
from dbbstation.plan.bar import UNKNOWN_BAR_MM

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.calibration.outliers.outlier import Fit, Step
    from dbbstation.computing.arrays import Floats
    from dbbstation.model.observation import Observation

SIGMAS = 5.0
"""Displacement of an outlying ball, in units of the stated or the usual scatter, whichever is larger."""

_TAIL = 2.0 * float(ndtr(-SIGMAS))

SAME_SIGMAS = 3.0
"""Mountings of a ball that differ by fewer standard deviations are at the same wrong place."""


def ball_moved(fit: Fit, calibration: Calibration, runs: Sequence[Observation]) -> Step | None:
    """Find a run whose ball moved within its mounting, give it a separate mounting, and refit; None without such a run."""
    k = _moved_in(calibration)
    if k is None:
        return None
    run = runs[k]
    others = [o for i, o in enumerate(runs) if i != k and o.setup.mounting == run.setup.mounting]
    if not others:
        return None
    own = replace(run, setup=replace(run.setup, mounting=f"{run.setup.mounting}, {run.label}"))
    apart = [own if i == k else o for i, o in enumerate(runs)]
    again = fit(apart)
    seats = {seat.mounting: seat for seat in seats_of(again)}
    shift = seats[own.setup.mounting].shift_mm - seats[others[0].setup.mounting].shift_mm
    size = 1e3 * hypot_of(*shift[:2])
    text = (
        f"the ball of test {run.test} moved by {_towards(shift)} between run {run.label} and {others[0].label}: "
        "holder or cup loose, or touched"
    )
    moved = Outlier(kind=OutlierKind.MOVED, test=run.test, runs=run.label, size_um=size, shift_um=_um(shift), text=text)
    return moved, apart, again


def _moved_in(calibration: Calibration) -> int | None:
    shifts = np.array([shift_of(o, r) for o, r in left_of(calibration)])
    away = np.hypot(*shifts.T)
    worst = place_of_largest(away)
    limit = max(STANDS_OUT * median_of(away), 1e-3 * LEAST_UM)
    return worst if away[worst] > limit else None


def off_its_place(fit: Fit, calibration: Calibration, runs: Sequence[Observation]) -> Step | None:
    """Free the ball with the largest displacement, in units of the usual scatter; None if no ball is an outlier."""
    seats = [seat for seat in seats_of(calibration) if seat.freedom > 0]
    if not seats:
        return None
    # By chance half of the values exceed the median; missing physics scatters all balls, so the limit grows with the
    # median.
    usual = max(1.0, median_of([seat.square / float(chdtri(seat.freedom, 0.5)) for seat in seats]))
    worst = max(seats, key=lambda seat: seat.square / seat.freedom)
    beyond = float(chdtri(worst.freedom, _TAIL))
    if worst.square < usual * beyond or np.hypot(*worst.shift_mm[:2]) < 1e-3 * LEAST_UM:
        return None
    return free_ball(fit, runs, worst.mounting, seats)


def free_ball(
    fit: Fit,
    runs: Sequence[Observation],
    mounting: str,
    seats: Sequence[MountingOffset],
    *,
    together: bool | None = None,
) -> Step:
    """Free the ball of a mounting, and in its other mountings if their displacements agree."""
    worst = next(seat for seat in seats if seat.mounting == mounting)
    alike = [seat for seat in seats if seat.ball == worst.ball and seat is not worst]
    if together is None:
        together = bool(alike) and all(_same(seat, worst) for seat in alike)
    names = {worst.mounting} | ({seat.mounting for seat in alike} if together else set())
    freed = [_freed(run) if run.setup.mounting in names else run for run in runs]
    if together:
        why = f", in all {len(names)} mountings alike: its CMM row, or it is another ball or holder"
    elif alike:
        why = ", but not when it was put up again: badly seated"
    else:
        why = ": badly seated, or its CMM row is wrong; put it up again to tell"
    kind = OutlierKind.BALL if together else OutlierKind.MOUNTING
    again = fit(freed)
    return _ball(again, kind, (mounting, *sorted(names - {mounting})), why, sure=bool(alike)), freed, again


def set_free(fit: Fit, before: Calibration, source: str, of: str) -> Step | None:
    """Free an outlier and refit; None if the fit fails.

    Args:
        source: `mounting`, `ball-coordinate` or `bar-offset`.
    """
    runs = before.observations
    try:
        if source == "bar-offset":
            return free_bar(fit, runs, of)
        together = source == "ball-coordinate"
        of_the_ball = {o.setup.mounting for o in runs if of == (o.setup.ball if together else o.setup.mounting)}
        return free_ball(fit, runs, min(of_the_ball), seats_of(before), together=together)
    except CalibrationError:
        return None


def free_bar(fit: Fit, runs: Sequence[Observation], session: str) -> Step:
    """Free the bar length of a session and refit."""
    of = [run for run in runs if run.setup.session == session]
    why = f", and ± {1e3 * of[0].setup.bar_uncertainty_mm:.2f} was stated: put it on its calibrator again"
    freed = [
        replace(run, setup=replace(run.setup, bar_uncertainty_mm=UNKNOWN_BAR_MM)) if run in of else run for run in runs
    ]
    again = fit(freed)
    return _bar(again, session, why), freed, again


def beside(outlier: Outlier, calibration: Calibration) -> Outlier:
    """Return a freed outlier with values from another fit; other outliers are returned unchanged."""
    if outlier.kind is OutlierKind.BAR:
        found = _bar(calibration, outlier.freed[0], outlier.why)
    elif outlier.freed:
        found = _ball(calibration, outlier.kind, outlier.freed, outlier.why, sure=outlier.sure)
    else:
        return outlier
    return replace(found, alike=outlier.alike)


def _ball(calibration: Calibration, kind: OutlierKind, freed: tuple[str, ...], why: str, *, sure: bool) -> Outlier:
    seat = next(seat for seat in seats_of(calibration) if seat.mounting == freed[0])
    of = [run for run in calibration.observations if run.setup.mounting in freed]
    tests = ", ".join(dict.fromkeys(run.test for run in of))
    which = f"in run {of[0].label}" if "," in of[0].setup.mounting and len(of) == 1 else f"of test {tests}"
    distance = hypot_of(*seat.shift_mm[:2])
    along = seat.shift_mm[:2] / max(distance, 1e-12)
    return Outlier(
        kind=kind,
        test=of[0].test,
        runs=", ".join(run.label for run in of),
        size_um=1e3 * distance,
        shift_um=_um(seat.shift_mm),
        text=f"the ball {which} stands {_towards(seat.shift_mm)} from its place{why}",
        sure=sure,
        uncertainty_um=1e3 * sqrt(along @ seat.spread_mm2[:2, :2] @ along),
        freed=freed,
        why=why,
    )


def _bar(calibration: Calibration, session: str, why: str) -> Outlier:
    terms = {(term.source.name, term.shared): term for term in calibration.layout.terms}
    column = terms["bar-offset", session].columns.start
    offset = 1e3 * float(calibration.x[column])
    sigma = 1e3 * sqrt(calibration.solution.covariance[column, column])
    longer = "long" if offset > 0.0 else "short"
    return Outlier(
        kind=OutlierKind.BAR,
        test=session,
        runs="all runs",
        size_um=offset,
        shift_um=None,
        text=f"the bar of {session} reads {abs(offset):.2f} ± {sigma:.2f} µm too {longer}{why}",
        uncertainty_um=sigma,
        freed=(session,),
        why=why,
    )


def _same(a: MountingOffset, b: MountingOffset) -> bool:
    sigma = np.sqrt(np.diag(a.spread_mm2)[:2] + np.diag(b.spread_mm2)[:2])
    return bool(np.all(np.abs(a.shift_mm - b.shift_mm)[:2] < SAME_SIGMAS * sigma))


def _freed(run: Observation) -> Observation:
    size = np.zeros(3) + run.setup.mounting_repeatability_mm
    seen = 3 if run.raw.circle.elevation_deg != 0.0 else 2
    size[:seen] = UNKNOWN_MM
    return replace(run, setup=replace(run.setup, mounting_repeatability_mm=size))


def _um(shift_mm: Floats) -> tuple[float, float, float]:
    x, y, z = (1e3 * shift_mm).tolist()
    return x, y, z


def _towards(shift_mm: Floats) -> str:
    angle = np.degrees(np.arctan2(shift_mm[1], shift_mm[0])) % 360.0
    return f"{1e3 * hypot_of(*shift_mm[:2]):.1f} µm towards {angle:.0f}°"
