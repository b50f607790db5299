"""Polar traces for SVG, and the circles of a report without the first cause."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.reporting.prediction import smooth_lengths_mm
from dbbstation.circles.estimates import BudgetQuantity
from dbbstation.computing.arrays import largest_size
from dbbstation.trace.analysis import horizontal_radius_mm, path_about_ball

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.effects import CuredCircle
    from dbbstation.plan.plan import Circle
    from dbbstation.results.circles import MeasuredCircle
    from dbbstation.results.report_verdict import Ranked

SIZE = 320
"""Width and height of a polar figure in drawing units."""

CIRCLE = 92.0
"""Radius of the nominal circle in the drawing."""

REACH = 44.0
"""Radial distance of a figure's greatest deviation from the nominal circle."""

BINS = 240
"""Number of bins of a turn. Each is drawn by its greatest and least deviation, so that the peak of a single reading
remains. Narrower bins are indistinguishable at the figure's size."""

MOST_DRAWN = 4
"""Greatest number of drawn repeats of one direction: more would cover one another. The number of the others is below
the figure."""

_STEPS = (1.0, 2.0, 5.0)


@dataclass(frozen=True, eq=False)
class PolarTrace:
    """A path to draw.

    Attributes:
        theta_deg: shape (n,).
        deviation_um: from the least-squares circle, shape (n,).
        points: of the polygon; empty until there is a scale.
    """

    theta_deg: Floats
    deviation_um: Floats
    direction: str
    name: str
    title: str
    former: bool = False
    thin: bool = False
    points: str = ""


@dataclass(frozen=True)
class Ring:
    """A circle of equal deviation."""

    radius: float
    um: float


@dataclass(frozen=True)
class Polar:
    """The circles of one test."""

    title: str
    what: str
    traces: tuple[PolarTrace, ...]
    rings: tuple[Ring, ...]
    step_um: float
    scale: float
    not_drawn: int


def polar(title: str, now: Sequence[MeasuredCircle], before: Sequence[MeasuredCircle] = ()) -> Polar:
    """Return a test's circles about their centres, before and now with one scale."""
    drawn = [(one, former, thin) for former, runs in ((True, before), (False, now)) for one, thin in chosen(runs)]
    paths = [
        PolarTrace(
            one.analysed.path.theta_deg,
            one.analysed.residual_um,
            str(one.entry.direction),
            f"{'before ' if former else ''}{str(one.entry.direction).upper()} {one.entry.repeat}",
            f"{'before: ' if former else ''}{one.entry.label}: G {one.budget(BudgetQuantity.G_LS).value_um:.1f} µm",
            former=former,
            thin=thin,
        )
        for one, former, thin in drawn
    ]
    made = polar_of(title, drawn[-1][0].analysed.raw.circle, paths, len(now) + len(before) - len(drawn))
    points = sorted(len(one.theta_deg) for one in paths)
    count = f"{points[0]} points" if points[0] == points[-1] else f"{points[0]} to {points[-1]} points"
    return replace(made, what=f"{made.what}, {count}")


def polar_of(title: str, circle: Circle, paths: Sequence[PolarTrace], not_drawn: int = 0) -> Polar:
    """Return the paths of one circle with one scale."""
    most_um = max(largest_size(one.deviation_um) for one in paths)
    scale = REACH / max(most_um, 1e-3)  # a perfect circle has no reach of its own
    tilt = ", ".join(f"{axis} {angle:g}°" for axis, angle in zip("ABC", circle.tilt_deg, strict=True) if angle)
    centre = ", ".join(f"{axis} {place:.10g}" for axis, place in zip("XYZ", circle.centre_mm, strict=True))
    step_um = step_of(most_um)
    return Polar(
        title=title,
        what=f"bar {circle.bar_mm:g} mm, {tilt or 'not tilted'}, {circle.feed_mm_min:g} mm/min, about {centre} mm, "
        f"from {circle.start_deg:g}°, {circle.overshoot_deg:g}° more at either end",
        traces=tuple(replace(one, points=_points(one.theta_deg, one.deviation_um, scale)) for one in paths),
        rings=tuple(Ring(CIRCLE + scale * um, um) for um in (-step_um, 0.0, step_um)),
        step_um=step_um,
        scale=scale,
        not_drawn=not_drawn,
    )


def step_of(most_um: float) -> float:
    """Return the largest step of ..., 1, 2, 5, 10, ... µm within a deviation, at least 0.001 µm."""
    most_um = max(most_um, 1e-3)
    power = 10.0 ** np.floor(np.log10(most_um))
    return float(max(step for step in _STEPS if step * power <= most_um * (1.0 + 1e-9)) * power)


def chosen(runs: Sequence[MeasuredCircle], most: int = MOST_DRAWN) -> list[tuple[MeasuredCircle, bool]]:
    """Return the runs to draw; all except the last of a direction are thin."""
    drawn: list[tuple[MeasuredCircle, bool]] = []
    for direction in dict.fromkeys(one.entry.direction for one in runs):
        of = [one for one in runs if one.entry.direction is direction][-most:]
        drawn += [(one, one is not of[-1]) for one in of]
    return drawn


def _points(theta_deg: Floats, deviation_um: Floats, scale: float) -> str:
    angle_deg, deviation = thinned(theta_deg, deviation_um)
    theta, radius = np.radians(angle_deg), CIRCLE + scale * deviation
    middle = SIZE / 2
    x, y = middle + radius * np.cos(theta), middle - radius * np.sin(theta)
    return " ".join(f"{one:.1f},{other:.1f}" for one, other in zip(x, y, strict=True))


def thinned(theta_deg: Floats, deviation_um: Floats) -> tuple[Floats, Floats]:
    """Return the extremes of each bin, in order of angle."""
    order = np.argsort(theta_deg, kind="stable")
    theta, deviation = theta_deg[order], deviation_um[order]
    kept = np.arange(len(theta)) if len(theta) <= 2 * BINS else _extremes(np.radians(theta), deviation)
    return theta[kept], deviation[kept]


def _extremes(theta: Floats, deviation: Floats) -> NDArray[np.intp]:
    stretch = np.minimum((theta / (2.0 * np.pi) * BINS).astype(np.intp), BINS - 1)
    by_size = np.lexsort((deviation, stretch))
    first = np.flatnonzero(np.diff(stretch[by_size], prepend=-1))
    last = np.append(first[1:], len(by_size)) - 1
    return np.unique(np.concatenate([by_size[first], by_size[last]]))


MOST_CURED = 6
"""Number of tests whose circles are drawn without the first cause: the tests on which it acts most."""


def cured_polars(ranked: Ranked) -> list[Polar]:
    """Return circles as measured and without the first cause."""
    if not ranked.effects:
        return []
    first = ranked.effects[0]
    of: dict[str, CuredCircle] = {}
    for circle in sorted(first.runs, key=lambda one: -one.g_um):
        of.setdefault(circle.test, circle)
    chosen = sorted(list(of.values())[:MOST_CURED], key=lambda one: one.test)
    return [_drawn(one) for one in chosen]


def _drawn(one: CuredCircle) -> Polar:
    measured, cured = _path(one, one.raw.length_mm), _path(one, one.raw.length_mm - one.effect_mm)
    return polar_of(
        f"test {one.test} {one.direction.upper()}: G {one.measured_g_um:.1f}, without it {one.cured_g_um:.1f} µm",
        one.raw.circle,
        [
            PolarTrace(*measured, one.direction, "measured", f"as measured: G {one.measured_g_um:.1f} µm", former=True),
            PolarTrace(*cured, one.direction, "without it", f"as it would be: G {one.cured_g_um:.1f} µm"),
        ],
    )


def _path(one: CuredCircle, length_mm: Floats) -> tuple[Floats, Floats]:
    path = path_about_ball(one.raw.theta_deg, horizontal_radius_mm(one.raw, smooth_lengths_mm(one.raw, length_mm)))
    return path.theta_deg, 1e3 * path.deviation_mm
