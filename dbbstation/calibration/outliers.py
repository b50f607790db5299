"""Runs and balls that do not belong: found one at a time, named, and kept from pulling the fit.

What is found is freed, not weighted: a ball that stands where it should not may stand anywhere, a run that is no
circle of this machine is left out. The rest is fitted as before, so that one solver serves and the intervals of
what remains are those of sound data.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from dbbstation.calibration.noise_level import fine_noise_mm
from dbbstation.calibration.scatter import LEAST_STATED_MM, UNKNOWN_MM, Seat, seats_of
from dbbstation.inference.square_root import solve

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from dbbstation.calibration.fit import Calibration
    from dbbstation.model.observation import Observation

    Fit = Callable[[Sequence[Observation]], Calibration]
    Step = tuple["Outlier", list[Observation], Calibration]

STANDS_OUT = 4.0
"""A run does not belong that leaves this many times what the usual one does ..."""

LEAST_UM = 3.0
"""... and more than a bar's noise could [µm]."""

FALLS, AT_NOISE = 4.0, 4.0
"""A test does not belong without which the others' mean square falls by the first, to less than the second in units of
the noise. Physics that the model lacks stays in the others."""

ALONE = 1.2
"""One run of a test is to blame where leaving it out does nearly all that leaving the test out does."""

SIGMAS = 5.0
"""Of the stated scatter, or of the usual one where that is more, by which a ball must be off its place."""

SAME_SIGMAS = 3.0
"""Two puttings-up of a ball that differ by less stand at the same wrong place."""

MOST = 8
"""Outliers that are looked for; more are no outliers but another machine or plan."""


class Kind(StrEnum):
    """What does not belong."""

    RUN = "run"
    WRONG_PLACE = "wrong-place"
    MOVED = "moved"
    MOUNTING = "mounting"
    BALL = "ball"
    BAR = "bar"


SOURCE_OF = {
    Kind.MOUNTING: "mounting",
    Kind.MOVED: "mounting",
    Kind.BALL: "ball-coordinate",
    Kind.WRONG_PLACE: "ball-coordinate",
    Kind.BAR: "bar-offset",
}
"""Name of the error source that is out of size; a run that is no circle of this machine is none."""


@dataclass(frozen=True)
class Outlier:
    """One thing that does not belong.

    Attributes:
        kind: what it is.
        test: name of the test; of the session for a bar.
        run: label of the run, or of the runs of one putting-up.
        size_um: how far off: rms of a run, distance of a ball from its place, error of a bar's length [µm].
        shift_um: where a ball stands, machine axes; None for a run [µm].
        text: what it looks like, in words.
        sure: False where a badly seated ball cannot be told from a wrong CMM row: it was put up once only.
        uncertainty_um: standard uncertainty of the size; None for a run [µm].
        alike: error sources that would explain the recordings about as well in its place.
        freed: names of the mountings that may stand anywhere, or of the session whose bar may have any length.
        why: end of the text, what it may come from.
    """

    kind: Kind
    test: str
    run: str
    size_um: float
    shift_um: tuple[float, float, float] | None
    text: str
    sure: bool = True
    uncertainty_um: float | None = None
    alike: tuple[str, ...] = ()
    freed: tuple[str, ...] = ()
    why: str = ""


def calibrate_robust(
    fit: Fit,
    observations: Sequence[Observation],
    *,
    balls: bool = True,
    begun: tuple[Calibration, tuple[Outlier, ...]] | None = None,
) -> tuple[Calibration, tuple[Outlier, ...]]:
    """Fit, and fit again without what does not belong.

    Args:
        fit: calibrates runs.
        observations: all runs.
        balls: look for balls off their place too, not only for runs that are no circle of this machine.
        begun: what was returned for these runs without balls, to go on from.

    Returns:
        The last fit, and what was found, in the order in which it stood out.

    Raises:
        CalibrationError: as `fit` does.
    """
    calibration, before = begun or (fit(list(observations)), ())
    runs, found = list(calibration.observations), list(before)
    while len(found) < MOST:
        step = _next(fit, calibration, runs, balls=balls)
        if step is None:
            break
        outlier, runs, calibration = step
        found.append(outlier)
    return calibration, tuple(found)


def _next(fit: Fit, calibration: Calibration, runs: Sequence[Observation], *, balls: bool) -> Step | None:
    """Return what stands out most, the runs without its pull, and their fit; None where nothing does."""
    strange = _strange_test(calibration) or _strange_run(calibration)
    if strange:
        return _without(fit, runs, strange)
    if not balls:
        return None
    moved = _moved_between(calibration)
    if moved is not None:
        step = _moved(fit, runs, moved)
        if step is not None:
            return step
    return _off_its_place(fit, calibration, runs)


# --- runs that are no circle of this machine ---


def _strange_test(calibration: Calibration) -> list[int]:
    """Indices of the runs of a test without which all others fall into place; empty where there is none.

    Both directions filed under the wrong test bend the whole fit and hardly stand out of it.
    """
    if _rms_um(np.concatenate(calibration.residual_mm)) < LEAST_UM:
        return []
    noise = max(fine_noise_mm(calibration), 1e-3 * LEAST_UM / STANDS_OUT)
    known, held = calibration.layout.known, calibration.solution.held
    tests: dict[tuple[str, str], list[int]] = {}
    for k, run in enumerate(calibration.observations):
        tests.setdefault((run.setup.session, run.test), []).append(k)

    def misfit(left_out: Sequence[int]) -> float:
        blocks = [block for k, block in enumerate(calibration.blocks) if k not in left_out]
        return solve(blocks, known, noise, held).chi2 / sum(block.count for block in blocks)

    without = {name: misfit(own) for name, own in tests.items()}
    best = min(without, key=without.__getitem__)
    falls = misfit([]) / without[best]
    in_place = falls > FALLS and without[best] < AT_NOISE
    if not (in_place or falls > STANDS_OUT**2):
        return []
    alone = [k for k in tests[best] if misfit([k]) < ALONE * without[best]]
    return alone[:1] or tests[best]


def _strange_run(calibration: Calibration) -> list[int]:
    """Index of the run that leaves most beside a shift of its own ball, if that is far more than usual."""
    rest = _rests_um(calibration)
    worst = int(np.argmax(rest))
    return [worst] if rest[worst] > _strange_from_um(rest) else []


def _rests_um(calibration: Calibration) -> NDArray[np.float64]:
    """What every run leaves beside a shift of its own ball, shape (r,) [µm]."""
    return np.array([_rms_um(_without_shift(run, left)) for run, left in _left(calibration)])


def _strange_from_um(rests_um: NDArray[np.float64]) -> float:
    """What a run must leave to be no circle of the machine [µm]."""
    return max(STANDS_OUT * float(np.median(rests_um)), LEAST_UM)


def in_place_after_all(
    calibration: Calibration, runs: Sequence[Observation], outliers: Sequence[Outlier]
) -> tuple[list[Observation], tuple[Outlier, ...]]:
    """Runs that belong, and the outliers that stay, where a fit knows physics that was not known when runs were left out.

    Args:
        calibration: of the runs that were kept, with that physics.
        runs: all runs.
        outliers: runs that were left out; others stay as they are.
    """

    def named(run: Observation) -> tuple[str, str]:
        return run.setup.session, run.label

    kept = {named(run) for run in calibration.observations}
    limit_um = _strange_from_um(_rests_um(calibration))

    def fits(run: Observation) -> bool:
        left = run.raw.length_mm - calibration.model.bar(run.motion()).length_mm
        return _rms_um(_without_shift(run, left)) < limit_um

    out = {named(run) for run in runs if named(run) not in kept and not fits(run)}
    labels = {label for _, label in out}
    staying = tuple(o for o in outliers if o.freed or labels & set(o.run.split(", ")))
    return [run for run in runs if named(run) not in out], staying


def _without(fit: Fit, runs: Sequence[Observation], strange: Sequence[int]) -> Step:
    """Leave runs of one test out, and see under the fit of the others what they are."""
    kept = [run for i, run in enumerate(runs) if i not in strange]
    again = fit(kept)
    run = runs[strange[0]]
    residual = run.raw.length_mm - again.model.bar(run.motion()).length_mm
    size = _rms_um(residual)
    kind, look = _looks_like(again, kept, run, residual)
    labels = ", ".join(runs[k].label for k in strange)
    return Outlier(kind, run.test, labels, size, None, f"{labels} leaves {size:.1f} µm rms: {look}"), kept, again


def _looks_like(
    calibration: Calibration, others: Sequence[Observation], run: Observation, residual: NDArray[np.float64]
) -> tuple[Kind, str]:
    """What a run that does not belong most resembles."""
    noise = _strange_from_um(np.array([_rms_um(left) for _, left in _left(calibration)]))
    best, where = np.inf, run
    for other in others:
        if other.raw.circle == run.raw.circle or other.raw.circle.bar_mm != run.raw.circle.bar_mm:
            continue
        there = replace(other, raw=replace(run.raw, circle=other.raw.circle), commanded=None)
        left = run.raw.length_mm - calibration.model.bar(there.motion()).length_mm
        rest = _rms_um(_without_shift(there, left))
        if rest < best:
            best, where = rest, other
    if best < noise:
        what = f"it is what test {where.test} {where.raw.circle.direction} should read, to {best:.1f} µm"
        if where.test == run.test:
            return Kind.WRONG_PLACE, f"{what}; was the other direction run?"
        return Kind.WRONG_PLACE, f"{what}; the ball stood in that bore, or the run was filed under the wrong test"
    step, at = _step(residual)
    if _rms_um(_without_step(residual, at)) < 0.5 * _rms_um(residual - residual.mean()):
        return (
            Kind.RUN,
            f"the reading steps by {1e3 * step:.1f} µm at {run.raw.theta_deg[at]:.0f}°; bar or holder was bumped",
        )
    return Kind.RUN, "no circle of this machine and no step; a bump, a loose ball, or another machine's run?"


def _step(residual: NDArray[np.float64]) -> tuple[float, int]:
    """Largest difference of means before and after a sample, and that sample; ends of a twentieth are not looked at."""
    count = len(residual)
    at = np.arange(count // 20 + 1, count - count // 20)
    total = np.cumsum(residual)
    difference = (total[-1] - total[at - 1]) / (count - at) - total[at - 1] / at
    weight = np.sqrt(at * (count - at))
    k = int(np.argmax(np.abs(difference) * weight))
    return float(difference[k]), int(at[k])


def _without_step(residual: NDArray[np.float64], at: int) -> NDArray[np.float64]:
    return np.concatenate([residual[:at] - residual[:at].mean(), residual[at:] - residual[at:].mean()])


# --- balls that are off their place ---


def _moved_between(calibration: Calibration) -> tuple[int, NDArray[np.float64]] | None:
    """Run whose ball stands elsewhere than in the other runs of its putting-up, and by how much (x, y) [mm]."""
    shifts = np.array([_shift(o, r) for o, r in _left(calibration)])
    away = np.hypot(*shifts.T)
    worst = int(np.argmax(away))
    limit = max(STANDS_OUT * float(np.median(away)), 1e-3 * LEAST_UM)
    return (worst, shifts[worst]) if away[worst] > limit else None


def _moved(fit: Fit, runs: Sequence[Observation], moved: tuple[int, NDArray[np.float64]]) -> Step | None:
    """Give a run a putting-up of its own; where its mounting has no other run there is nothing to be apart from."""
    k, _ = moved
    run = runs[k]
    others = [o for i, o in enumerate(runs) if i != k and o.setup.mounting == run.setup.mounting]
    if not others:
        return None
    own = replace(run, setup=replace(run.setup, mounting=f"{run.setup.mounting}, {run.label}"))
    apart = [own if i == k else o for i, o in enumerate(runs)]
    again = fit(apart)
    seats = {seat.mounting: seat for seat in seats_of(again)}
    shift = seats[own.setup.mounting].shift_mm - seats[others[0].setup.mounting].shift_mm
    size = 1e3 * float(np.hypot(*shift[:2]))
    text = (
        f"the ball of test {run.test} moved by {_towards(shift)} between run {run.label} and {others[0].label}: "
        "holder or cup loose, or touched"
    )
    return Outlier(Kind.MOVED, run.test, run.label, size, _um(shift), text), apart, again


def _off_its_place(fit: Fit, calibration: Calibration, runs: Sequence[Observation]) -> Step | None:
    """Free the ball that is furthest off its place in units of what is usual."""
    seats = [seat for seat in seats_of(calibration) if seat.freedom > 0]
    if not seats:
        return None
    # By chance half of them lie beyond their median: a model that lacks physics scatters all balls.
    usual = max(1.0, float(np.median([seat.square / float(chdtri(seat.freedom, 0.5)) for seat in seats])))
    worst = max(seats, key=lambda seat: seat.square / seat.freedom)
    beyond = float(chdtri(worst.freedom, _TAIL))
    if worst.square < usual * beyond or np.hypot(*worst.shift_mm[:2]) < 1e-3 * LEAST_UM:
        return None
    return free_ball(fit, runs, worst.mounting, seats)


def free_ball(
    fit: Fit, runs: Sequence[Observation], mounting: str, seats: Sequence[Seat], *, together: bool | None = None
) -> Step:
    """Let the ball of a mounting stand anywhere, with all its other mountings if it stands alike in them.

    Args:
        fit: calibrates runs.
        runs: all runs.
        mounting: name of the putting-up that is off.
        seats: of a fit of these runs.
        together: whether it stands alike in all of them, where that is known; seen from the seats if None.

    Returns:
        What was found, the runs without its pull, and their fit.
    """
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
    kind = Kind.BALL if together else Kind.MOUNTING
    again = fit(freed)
    return _ball(again, kind, (mounting, *sorted(names - {mounting})), why, sure=bool(alike)), freed, again


def free_bar(fit: Fit, runs: Sequence[Observation], session: str) -> Step:
    """Let the bar of a session have any length.

    Args:
        fit: calibrates runs.
        runs: all runs.
        session: whose bar is off.

    Returns:
        What was found, the runs without its pull, and their fit.
    """
    of = [run for run in runs if run.setup.session == session]
    why = f", and ± {1e3 * of[0].setup.bar_uncertainty_mm:.2f} was stated: put it on its calibrator again"
    freed = [
        replace(run, setup=replace(run.setup, bar_uncertainty_mm=UNKNOWN_BAR_MM)) if run in of else run for run in runs
    ]
    again = fit(freed)
    return _bar(again, session, why), freed, again


def beside(outlier: Outlier, calibration: Calibration) -> Outlier:
    """What was set free as another fit finds it, such as one with the physics that pulled it; others as they are."""
    if outlier.kind is Kind.BAR:
        found = _bar(calibration, outlier.freed[0], outlier.why)
    elif outlier.freed:
        found = _ball(calibration, outlier.kind, outlier.freed, outlier.why, sure=outlier.sure)
    else:
        return outlier
    return replace(found, alike=outlier.alike)


def _ball(calibration: Calibration, kind: Kind, freed: tuple[str, ...], why: str, *, sure: bool) -> Outlier:
    """A ball that may stand anywhere, as a fit finds it in the first of its mountings."""
    seat = next(seat for seat in seats_of(calibration) if seat.mounting == freed[0])
    of = [run for run in calibration.observations if run.setup.mounting in freed]
    which = f"in run {of[0].label}" if "," in of[0].setup.mounting and len(of) == 1 else f"of test {_tests(of)}"
    distance = float(np.hypot(*seat.shift_mm[:2]))
    along = seat.shift_mm[:2] / max(distance, 1e-12)
    return Outlier(
        kind=kind,
        test=of[0].test,
        run=", ".join(run.label for run in of),
        size_um=1e3 * distance,
        shift_um=_um(seat.shift_mm),
        text=f"the ball {which} stands {_towards(seat.shift_mm)} from its place{why}",
        sure=sure,
        uncertainty_um=1e3 * float(np.sqrt(along @ seat.spread_mm2[:2, :2] @ along)),
        freed=freed,
        why=why,
    )


def _bar(calibration: Calibration, session: str, why: str) -> Outlier:
    """A bar that may have any length, as a fit finds it."""
    terms = {(term.source.name, term.shared): term for term in calibration.layout.terms}
    column = terms["bar-offset", session].columns.start
    offset = 1e3 * float(calibration.x[column])
    sigma = 1e3 * float(np.sqrt(calibration.solution.covariance[column, column]))
    longer = "long" if offset > 0.0 else "short"
    return Outlier(
        kind=Kind.BAR,
        test=session,
        run="all runs",
        size_um=offset,
        shift_um=None,
        text=f"the bar of {session} reads {abs(offset):.2f} ± {sigma:.2f} µm too {longer}{why}",
        uncertainty_um=sigma,
        freed=(session,),
        why=why,
    )


UNKNOWN_BAR_MM = LEAST_STATED_MM
"""Stated size of the error of a bar that nobody set on a calibrator: no scatter that anybody states [mm]."""

_TAIL = 5.7e-7
"""Chance of a normal variable beyond `SIGMAS`."""


def _same(a: Seat, b: Seat) -> bool:
    sigma = np.sqrt(np.diag(a.spread_mm2)[:2] + np.diag(b.spread_mm2)[:2])
    return bool(np.all(np.abs(a.shift_mm - b.shift_mm)[:2] < SAME_SIGMAS * sigma))


def _freed(run: Observation) -> Observation:
    """The run about a ball that may stand anywhere, in height only where a raised bar sees it."""
    size = np.zeros(3) + run.setup.mounting_repeatability_mm
    seen = 3 if run.raw.circle.elevation_deg != 0.0 else 2
    size[:seen] = UNKNOWN_MM
    return replace(run, setup=replace(run.setup, mounting_repeatability_mm=size))


# --- what a run leaves ---


def _tests(runs: Sequence[Observation]) -> str:
    return ", ".join(dict.fromkeys(run.test for run in runs))


def _left(calibration: Calibration) -> list[tuple[Observation, NDArray[np.float64]]]:
    return list(zip(calibration.observations, calibration.residual_mm, strict=True))


def _shift(observation: Observation, residual: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shift of the ball that would explain a residual best, in X and Y, shape (2,) [mm]."""
    return -np.asarray(np.linalg.lstsq(_harmonics(observation), residual, rcond=None)[0][:2], dtype=np.float64)


def _without_shift(observation: Observation, residual: NDArray[np.float64]) -> NDArray[np.float64]:
    columns = _harmonics(observation)[:, :2]
    return residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]


def _harmonics(observation: Observation) -> NDArray[np.float64]:
    theta = np.radians(observation.raw.theta_deg)
    flat = np.cos(np.radians(observation.raw.circle.elevation_deg))
    return np.column_stack([flat * np.cos(theta), flat * np.sin(theta), np.ones(len(theta))])


def _rms_um(residual: NDArray[np.float64]) -> float:
    return 1e3 * float(np.sqrt(np.mean(residual**2)))


def _um(shift_mm: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = (1e3 * shift_mm).tolist()
    return x, y, z


def _towards(shift_mm: NDArray[np.float64]) -> str:
    """Length and direction of a shift in the plane, such as `31 µm towards 270°`."""
    angle = np.degrees(np.arctan2(shift_mm[1], shift_mm[0])) % 360.0
    return f"{1e3 * float(np.hypot(*shift_mm[:2])):.1f} µm towards {angle:.0f}°"
