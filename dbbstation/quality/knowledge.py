"""Inputs for judging a run: the expected circle and other runs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.circles.analysis import CircleAnalysis, analyse, feed_shown
from dbbstation.computing.arrays import hypot_of, norm_of
from dbbstation.errors import TraceError
from dbbstation.inference.harmonics import SAMPLES_PER_HARMONIC, amplitudes
from dbbstation.trace.cut import FeedingWay, cut, edges_of, feeding_ways, lost_on_turn
from dbbstation.trace.expected import COEFFICIENTS, HIGHEST_HARMONIC, LOCAL_COEFFICIENTS, LOCAL_HARMONIC

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats
    from dbbstation.plan.plan import Circle
    from dbbstation.quality.finding import Finding
    from dbbstation.trace.expected import Expected
    from dbbstation.trace.recording import RawCircle, Recording


@dataclass(frozen=True, eq=False)
class Planned:
    """A planned circle with its expectation."""

    test: str
    circle: Circle
    expected: Expected

    @property
    def label(self) -> str:
        """Return its name in texts."""
        return f"{self.test} {self.circle.direction}"


@dataclass(frozen=True, eq=False)
class Run:
    """A run with the knowledge needed to judge it.

    Attributes:
        mounting: label; runs with equal labels share the ball's place.
        started_s: on the session's clock; None if not noted.
        usual: expectation from usual causes if `expected` comes from a model; else None.
        bar_stated: whether a calibrated bar length is stated.
    """

    test: str
    repeat: int
    mounting: str
    circle: Circle
    recording: Recording
    expected: Expected | None = None
    largest_loss_percent: float = 0.0
    planned: tuple[Planned, ...] = ()
    started_s: float | None = None
    usual: Expected | None = None
    bar_stated: bool = True

    @property
    def label(self) -> str:
        """Return its name in texts."""
        return f"{self.test} {self.circle.direction} {self.repeat}"


@dataclass(frozen=True, eq=False)
class Seen:
    """A run with results that are computed once.

    Attributes:
        analysis: None without circle.
        unusable: samples of `lost` that were recorded but are unusable.
        feed_mm_min: feed shown by the overlap, with standard uncertainty; or None.
        longer_s: measured less programmed time from feed-in to feed-out; None without both edges or with recorded angles.
        coefficients_um: orthonormal Fourier coefficients of readings less bar length, shape (7,): mean, cosines, sines
            of harmonics 1 to 3, by commanded angle from the start towards +Y.
        local_um: coefficients of `local_columns`, shape (59,); zeros for too few samples.
    """

    run: Run
    analysis: CircleAnalysis | None
    problem: str
    lost: tuple[int, int]
    feed_mm_min: tuple[float, float] | None = None
    longer_s: float | None = None
    coefficients_um: Floats = field(default_factory=lambda: np.zeros(COEFFICIENTS))
    unusable: int = 0
    local_um: Floats = field(default_factory=lambda: np.zeros(LOCAL_COEFFICIENTS))
    ways: tuple[FeedingWay, FeedingWay] | None = None

    @cached_property
    def without_model(self) -> Seen:
        """Return the run with the expectation from usual causes instead of a model's."""
        if self.run.usual is None:
            return self
        return replace(self, run=replace(self.run, expected=self.run.usual, usual=None, planned=()))

    @cached_property
    def stretches(self) -> dict[int, NDArray[np.uint64]]:
        """Return a cache of sorted stretches of readings, by length, for `copied`."""
        return {}

    @cached_property
    def alone(self) -> list[Finding]:
        """Return a cache of the findings for which a run and its own expectation suffice, for `by_itself`."""
        return []

    @cached_property
    def u_um(self) -> float:
        """Return the standard uncertainty of each coefficient due to noise [µm]."""
        if self.analysis is None:
            return 0.0
        return self.analysis.noise.sigma_um / sqrt(len(self.analysis.raw))

    @cached_property
    def drift_um(self) -> tuple[float, float] | None:
        """Return the overlap's drift over the turn, with standard uncertainty due to noise [µm]; None without overlap."""
        if self.analysis is None or self.analysis.passes is None:
            return None
        return self.analysis.passes.mean_um, self.analysis.passes.u_mean_um(self.analysis.noise.sigma_um)

    @cached_property
    def drift_um_s(self) -> float:
        """Return the overlap's drift rate [µm/s]; zero without overlap."""
        passes = None if self.analysis is None else self.analysis.passes
        return 0.0 if passes is None else passes.mean_um / passes.turn_s


def seen(run: Run) -> Seen:
    """Cut and analyse a run."""
    *counts, unusable = lost_on_turn(run.recording, run.circle)
    lost = counts[0], counts[1]
    try:
        analysis = analyse(cut(run.recording, run.circle), run.recording)
    except TraceError as error:
        return Seen(run, None, f"{error.what}; {error.remedy}", lost, _feed_of(run), _longer_s(run), unusable=unusable)
    raw = analysis.raw
    local = np.zeros(LOCAL_COEFFICIENTS)
    if len(raw) > SAMPLES_PER_HARMONIC * LOCAL_HARMONIC:
        long_um = 1e3 * (raw.length_mm - raw.circle.bar_mm)
        local = _orthonormal(amplitudes(long_um, np.radians(raw.theta_deg), LOCAL_HARMONIC))
    form = coefficients_um(raw)
    return Seen(run, analysis, "", lost, analysis.feed_mm_min, _longer_s(run), form, unusable, local, _ways(run))


def coefficients_um(raw: RawCircle) -> Floats:
    """Return a circle's form as in `Seen.coefficients_um`."""
    theta = np.radians(raw.theta_deg - raw.circle.start_deg)
    return _orthonormal(amplitudes(1e3 * (raw.length_mm - raw.circle.bar_mm), theta, HIGHEST_HARMONIC))


def _orthonormal(found: NDArray[np.complex128]) -> Floats:
    waves = found[1:] / np.sqrt(2.0)
    return np.concatenate([found[:1].real, waves.real, -waves.imag])


def _feed_of(run: Run) -> tuple[float, float] | None:
    try:
        return feed_shown(run.recording, run.circle)
    except TraceError:
        return None


def _longer_s(run: Run) -> float | None:
    if run.recording.theta_deg is not None:
        return None
    try:
        begun_s, ended_s = edges_of(run.recording, run.circle)
    except TraceError:
        return None
    return ended_s - begun_s - due_s(run.circle)


def _ways(run: Run) -> tuple[FeedingWay, FeedingWay] | None:
    if run.recording.theta_deg is not None:
        return None
    try:
        return feeding_ways(run.recording, run.circle, edges_of(run.recording, run.circle))
    except TraceError:
        return None


def due_s(circle: Circle) -> float:
    """Return the programmed time between the midpoints of feed-in and feed-out [s]."""
    return circle.swept_s + circle.feeding_s


@dataclass(frozen=True, eq=False)
class Others:
    """Figures of a session's other runs, and the runs to compare with.

    Attributes:
        directions_um: rms differences between both directions of other circles.
        directions_stated: the same differences in stated standard deviations.
        across_um: differences in the coefficients of `ACROSS`.
        local_um: rms local differences between both directions of other circles.
        opposite: run of the same test in the other direction, on the same mounting if possible; or None.
    """

    noise_um: tuple[float, ...] = ()
    closure_um: tuple[tuple[float, float], ...] = ()
    drift_um: tuple[tuple[float, float], ...] = ()
    longer_s: tuple[float, ...] = ()
    directions_um: tuple[tuple[float, float], ...] = ()
    repeats_um: tuple[tuple[float, float], ...] = ()
    directions_stated: tuple[float, ...] = ()
    repeats_stated: tuple[float, ...] = ()
    across_um: tuple[float, ...] = ()
    local_um: tuple[float, ...] = ()
    opposite: Seen | None = None
    earlier: Seen | None = None
    every: tuple[Seen, ...] = ()


def apart_um(one: Seen, other: Seen) -> tuple[float, float]:
    """Return two runs' rms difference up to three undulations, and the standard uncertainty of each coefficient [µm]."""
    return norm_of(one.coefficients_um - other.coefficients_um), hypot_of(one.u_um, other.u_um)


ACROSS = (HIGHEST_HARMONIC + 1, HIGHEST_HARMONIC + 3)
"""Indices of odd coefficients that change sign when a circle is mirrored about the axis through its start: sines of harmonics 1 and 3."""


def across(one: Seen) -> Floats:
    """Return the coefficients of `ACROSS`, shape (2,) [µm]."""
    return one.coefficients_um[list(ACROSS)]
