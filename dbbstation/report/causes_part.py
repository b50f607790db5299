"""The circles of a report without the first cause."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from dbbstation.calibration.reporting.prediction import smooth_lengths_mm
from dbbstation.report.polar import Drawn, polar_of
from dbbstation.trace.analysis import horizontal_radius_mm, path_about_ball

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.effects import CuredCircle
    from dbbstation.report.polar import Polar
    from dbbstation.results.ranked import Ranked

MOST_DRAWN = 6
"""Number of tests whose circles are drawn without the first cause: the tests on which it acts most."""


class TitledPolar(NamedTuple):
    """A polar trace with its title."""

    title: str
    drawing: Polar


def cured_polars(ranked: Ranked) -> list[TitledPolar]:
    """Return circles as measured and without the first cause."""
    if not ranked.effects:
        return []
    first = ranked.effects[0]
    of: dict[str, CuredCircle] = {}
    for circle in sorted(first.runs, key=lambda one: -one.g_um):
        of.setdefault(circle.test, circle)
    chosen = sorted(list(of.values())[:MOST_DRAWN], key=lambda one: one.test)
    return [
        TitledPolar(
            f"test {one.test} {one.direction.upper()}: G {one.measured_g_um:.1f}, without it {one.cured_g_um:.1f} µm",
            _drawn(one),
        )
        for one in chosen
    ]


def _drawn(one: CuredCircle) -> Polar:
    measured, cured = _path(one, one.raw.length_mm), _path(one, one.raw.length_mm - one.effect_mm)
    return polar_of(
        one.test,
        one.raw.circle,
        [
            Drawn(*measured, one.direction, "measured", f"as measured: G {one.measured_g_um:.1f} µm", former=True),
            Drawn(*cured, one.direction, "without it", f"as it would be: G {one.cured_g_um:.1f} µm"),
        ],
    )


def _path(one: CuredCircle, length_mm: Floats) -> tuple[Floats, Floats]:
    path = path_about_ball(one.raw.theta_deg, horizontal_radius_mm(one.raw, smooth_lengths_mm(one.raw, length_mm)))
    return path.theta_deg, 1e3 * path.deviation_mm
