"""Figures of one circle, or of both directions, by ISO 230-4."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.circles.noise import noise_of
from dbbstation.circles.path import CirclePath, Filter, both, path_of
from dbbstation.circles.reversals import AXES_DEG, closure_of, harmonics_of, step_at
from dbbstation.computing.arrays import place_of_largest, range_of
from dbbstation.computing.threads import with_one_thread
from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.trace.analysis import figures, passes_of
from dbbstation.trace.cut import edges_of, overlap_feed
from dbbstation.trace.recording import lost_samples

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.circles.noise import CircleNoise
    from dbbstation.circles.reversals import Harmonic, ReversalStep
    from dbbstation.computing.arrays import Floats
    from dbbstation.plan.plan import Circle
    from dbbstation.trace.analysis import Passes
    from dbbstation.trace.recording import RawCircle, Recording

EDITION = "ISO 230-4:2005"
"""Edition whose terms the figures use. docs/circles.md defines them; the text of the standard was not available."""


@dataclass(frozen=True)
class Deviations:
    """Greatest and least radial deviation from the nominal radius, outwards positive."""

    largest_um: float
    least_um: float


@dataclass(frozen=True, eq=False)
class CircleAnalysis:
    """One circle in one direction.

    Attributes:
        centre_mm: least-squares less commanded, X and Y.
        radius_error_um: least-squares less nominal radius.
        mean_radial_error_um: mean reading less nominal length [CAL Table III].
        steps: at reversals of X and Y on the turn.
        closure: end less beginning of the turn; None for too few samples.
        passes: None without overlap.
        feed_mm_min: feed computed from the overlap, with standard uncertainty; or None.
        residual_um: from the least-squares circle, unfiltered, in time order, shape (n,).
    """

    raw: RawCircle
    chosen: Filter
    path: CirclePath
    g_least_squares_um: float
    centre_mm: tuple[float, float]
    radius_error_um: float
    mean_radial_error_um: float
    f_centred: Deviations
    f_commanded: Deviations
    steps: tuple[ReversalStep, ...]
    harmonics: tuple[Harmonic, ...]
    closure: ReversalStep | None
    passes: Passes | None
    feed_mm_min: tuple[float, float] | None
    noise: CircleNoise
    lost: int
    residual_um: Floats

    @cached_property
    def g_um(self) -> float:
        """Return the circular deviation G by minimum zone [µm]."""
        return 1e3 * self.path.zone().width_mm


@with_one_thread
def analyse(raw: RawCircle, recording: Recording | None = None, chosen: Filter = Filter.NONE) -> CircleAnalysis:
    """Compute all figures of a circle.

    Args:
        recording: for feed, overlap and losses; None for the turn alone.
        chosen: filter of G, F and H; other figures are unfiltered.

    Raises:
        TraceError: the points do not determine a circle.
    """
    plain = path_of(raw)
    path = path_of(raw, chosen) if chosen else plain
    measured = figures(raw)
    residual_um = 1e3 * plain.least_squares.deviation_mm
    noise = noise_of(_without_drift(raw, residual_um), raw.phi_deg, raw.length_mm)
    sigma = noise.sigma_um
    steps = (step_at(raw, residual_um, theta_deg, sigma) for theta_deg in AXES_DEG)
    radius_error_um = 1e3 * (plain.least_squares.radius_mm - plain.radius_mm)
    return CircleAnalysis(
        raw=raw,
        chosen=chosen,
        **_of_path(path, radius_error_um),
        centre_mm=measured.centre_mm,
        radius_error_um=radius_error_um,
        mean_radial_error_um=measured.mean_radial_error_um,
        steps=tuple(step for step in steps if step is not None),
        harmonics=harmonics_of(plain),
        closure=closure_of(raw, residual_um, sigma),
        passes=None if recording is None else passes_of(recording, raw.circle),
        feed_mm_min=None if recording is None else feed_shown(recording, raw.circle, 1e-3 * sigma),
        noise=noise,
        lost=0 if recording is None else lost_samples(recording.t_s),
        residual_um=residual_um,
    )


def refiltered(one: CircleAnalysis, chosen: Filter) -> CircleAnalysis:
    """Return a circle with another filter of G, F and H.

    Raises:
        TraceError: as `analyse`.
    """
    if chosen is one.chosen:
        return one
    return replace(one, chosen=chosen, **_of_path(path_of(one.raw, chosen), one.radius_error_um))


def _of_path(path: CirclePath, radius_error_um: float) -> Mapping[str, Any]:
    """Return the figures that the filter affects."""
    deviation_mm = path.least_squares.deviation_mm
    return {
        "path": path,
        "g_least_squares_um": 1e3 * range_of(deviation_mm),
        "f_centred": _extremes(radius_error_um + 1e3 * deviation_mm),
        "f_commanded": _extremes(1e3 * (path.about_ball_mm - path.radius_mm)),
    }


def _without_drift(raw: RawCircle, residual_um: Floats) -> Floats:
    apart = closure_of(raw, residual_um, 0.0)
    return residual_um if apart is None else residual_um - apart.height_um * raw.phi_deg / FULL_TURN_DEG


def _extremes(deviation_um: Floats) -> Deviations:
    return Deviations(float(deviation_um.max()), float(deviation_um.min()))


def feed_shown(recording: Recording, circle: Circle, noise_mm: float = 0.0) -> tuple[float, float] | None:
    """Return the overlap's feed and standard uncertainty [mm/min], or None.

    Args:
        noise_mm: noise of a sample for slow figures.

    Raises:
        TraceError: feed-in or feed-out is missing.
    """
    if recording.theta_deg is not None:
        return None
    return overlap_feed(recording, circle, edges_of(recording, circle), noise_mm)


@dataclass(frozen=True, eq=False)
class PairAnalysis:
    """One circle in both directions, on one mounting.

    Attributes:
        one: first in time.
        g_um: bi-directional circular deviation G(b), minimum zone.
        d_um: mean bi-directional radial deviation D: common least-squares radius less nominal radius.
        h_um: circular hysteresis H: greatest radial difference at one angle.
    """

    one: CircleAnalysis
    other: CircleAnalysis
    together: CirclePath
    g_um: float
    g_least_squares_um: float
    d_um: float
    h_um: float
    h_deg: float


@with_one_thread
def analyse_pair(one: CircleAnalysis, other: CircleAnalysis) -> PairAnalysis:
    """Compute the figures of both directions of a circle.

    Raises:
        TraceError: as `analyse`.
    """
    together = both(one.path, other.path)
    theta_deg = np.sort(one.path.theta_deg)
    radii = [
        np.interp(theta_deg, path.theta_deg, path.about_ball_mm, period=FULL_TURN_DEG)
        for path in (one.path, other.path)
    ]
    apart = 1e3 * np.abs(radii[0] - radii[1])
    widest = place_of_largest(apart)
    return PairAnalysis(
        one=one,
        other=other,
        together=together,
        g_um=1e3 * together.zone().width_mm,
        g_least_squares_um=1e3 * range_of(together.least_squares.deviation_mm),
        d_um=1e3 * (together.least_squares.radius_mm - together.radius_mm),
        h_um=float(apart[widest]),
        h_deg=float(theta_deg[widest]),
    )
