"""Knowledge before a run is judged: expected circle and other runs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.circles.analysis import CircleAnalysis, analyse, feed_shown
from dbbstation.errors import TraceError
from dbbstation.inference.harmonics import SAMPLES_PER_HARMONIC, amplitudes
from dbbstation.trace.cut import cut, edges_of, lost_on_turn, unusable_on_turn
from dbbstation.trace.feeding import FeedingWay, feeding_ways

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats
    from dbbstation.plan.circle import Circle
    from dbbstation.trace.circle import RawCircle
    from dbbstation.trace.recording import Recording

HIGHEST_HARMONIC = 3
"""Undulations per revolution up to which runs are compared: mean, centre, ellipse and triangle are what a wrong ball, bar, tilt
or direction changes, and seven numbers of thousands of samples are known to hundredths of a micrometre."""

LOCAL_HARMONIC = 29
"""Undulations per revolution up to which runs are compared for what happened at one place: below those that noise is read from."""

LOCAL_COEFFICIENTS = 2 * LOCAL_HARMONIC + 1
"""Numbers of a form of so many undulations, as of `local_columns`."""


def local_columns(theta_rad: Floats) -> Floats:
    """Return readings per orthonormal coefficient with `LOCAL_HARMONIC` undulations, shape (n, 59)."""
    angles = np.outer(theta_rad, np.arange(1, LOCAL_HARMONIC + 1))
    return np.hstack([np.ones((len(theta_rad), 1)), np.sqrt(2.0) * np.cos(angles), np.sqrt(2.0) * np.sin(angles)])


COEFFICIENTS = 2 * HIGHEST_HARMONIC + 1
"""Numbers of a form: its mean, and a cosine and a sine of each harmonic."""

HIGHER = (2, 3, 5, 6)
"""Those of two and three undulations, which no shift of a ball and no length of a bar makes."""


def form_columns(theta_rad: Floats) -> Floats:
    """Return readings per orthonormal coefficient of a form, shape (n, 7)."""
    angles = np.outer(theta_rad, np.arange(1, HIGHEST_HARMONIC + 1))
    return np.hstack([np.ones((len(theta_rad), 1)), np.sqrt(2.0) * np.cos(angles), np.sqrt(2.0) * np.sin(angles)])


def along_travel(circle: Circle) -> Floats:
    """Return the signs of coefficients counted along the travel, shape (7,)."""
    return np.concatenate([np.ones(HIGHEST_HARMONIC + 1), np.full(HIGHEST_HARMONIC, circle.direction.sign)])


@dataclass(frozen=True, eq=False)
class Expected:
    """An expected circle by nominal machine or model.

    Attributes:
        centre_mm: X and Y minus commanded, shape (2,).
        radial_mm: mean reading less nominal bar length.
        covariance_mm2: of these three, with ball, mounting and bar, shape (3, 3).
        place_known: False under the spindle, where centres are meaningless.
        mounting_mm: standard deviation of remounting, in X and Y.
        reversals_deg: from +X, where a strut reverses.
        form_um: as `Seen.coefficients_um`, shape (7,).
        effects_um: one standard deviation of each cause on these, shape (7, p) each, by cause and set of values shared with other
            runs.
        local_um: the same of causes along path or time, on `local_columns`, shape (59, p) each.
        moving: keys of causes that act only in motion.
        again_um2: covariance of the difference of two remounted runs, shape (7, 7).
        place_um: stated standard deviation of the ball's place, CMM and holder, per axis.
        known_um2: covariance of a sound form with noise, given other tests, shape (7, 7); None without.
    """

    centre_mm: Floats
    radial_mm: float
    covariance_mm2: Floats
    place_known: bool = True
    mounting_mm: float = 0.0
    reversals_deg: tuple[float, ...] = ()
    form_um: Floats = field(default_factory=lambda: np.zeros(COEFFICIENTS))
    effects_um: Mapping[tuple[str, str], Floats] = field(default_factory=dict)
    local_um: Mapping[tuple[str, str], Floats] = field(default_factory=dict)
    moving: frozenset[tuple[str, str]] = frozenset()
    again_um2: Floats = field(default_factory=lambda: np.zeros((COEFFICIENTS, COEFFICIENTS)))
    place_um: float = 0.0
    known_um2: Floats | None = None


@dataclass(frozen=True, eq=False)
class Planned:
    """A planned circle by a model."""

    test: str
    circle: Circle
    expected: Expected

    @property
    def label(self) -> str:
        """Return its name in texts."""
        return f"{self.test} {self.circle.direction}"


@dataclass(frozen=True, eq=False)
class Run:
    """One run as it is judged.

    Attributes:
        mounting: its runs share the ball's place.
        started_s: on the session's clock; None if not noted.
        usual: expectation by usual causes if `expected` is by a model; else None.
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
    """A run with what is computed once.

    Attributes:
        analysis: None without circle.
        unusable: recorded, but unusable, of these.
        feed_mm_min: by the overlap, with standard uncertainty; or None.
        longer_s: excess over the programmed time from feed-in to feed-out; None without both edges or with recorded angles.
        coefficients_um: orthonormal Fourier coefficients of readings less bar length, harmonics 0 to 3 by commanded angle from
            the start towards +Y: mean, cosines, sines, shape (7,).
        local_um: up to `LOCAL_HARMONIC`, as `local_columns`, shape (59,); zeros for too few samples.
        ways: feed-in and feed-out; None if not recorded.
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
        """Return the run without a model's expectation."""
        if self.run.usual is None:
            return self
        return replace(self, run=replace(self.run, expected=self.run.usual, usual=None, planned=()))

    @cached_property
    def stretches(self) -> dict[int, NDArray[np.uint64]]:
        """Return sorted stretches of readings by length, filled by `copied`."""
        return {}

    @cached_property
    def u_um(self) -> float:
        """Return each coefficient's standard uncertainty by noise [µm]."""
        if self.analysis is None:
            return 0.0
        return self.analysis.noise.sigma_um / float(np.sqrt(len(self.analysis.raw)))

    @cached_property
    def drift_um(self) -> tuple[float, float] | None:
        """Return the drift over the turn by the overlap, with standard uncertainty by noise; None without overlap [µm]."""
        if self.analysis is None or self.analysis.passes is None:
            return None
        return self.analysis.passes.mean_um, self.analysis.passes.u_mean_um(self.analysis.noise.sigma_um)

    @cached_property
    def drift_um_s(self) -> float:
        """Return the drift at one place by the overlap; zero without overlap [µm/s]."""
        passes = None if self.analysis is None else self.analysis.passes
        return 0.0 if passes is None else passes.mean_um / passes.turn_s


def seen(run: Run) -> Seen:
    """Cut and analyse a run."""
    lost = lost_on_turn(run.recording, run.circle)
    unusable = unusable_on_turn(run.recording, run.circle)
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
    """Return a circle's form as of `Seen.coefficients_um`."""
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
    """Return the programmed time from the middle of feed-in to that of feed-out [s]."""
    return circle.swept_deg / circle.turning_deg_s + circle.feed_in_mm / (circle.feed_mm_min / 60.0)


@dataclass(frozen=True, eq=False)
class Others:
    """A session's other runs, and related ones.

    Attributes:
        directions_um: rms difference of other circles' directions.
        directions_stated: the same in stated standard deviations.
        across_um: the same off the axis through the start.
        local_um: local rms difference of other circles' directions.
        opposite: same test, other direction, same mounting if possible; or None.
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
    """Return the rms difference of two runs up to three undulations, and each coefficient's uncertainty [µm]."""
    return float(np.linalg.norm(one.coefficients_um - other.coefficients_um)), float(np.hypot(one.u_um, other.u_um))


ACROSS = (HIGHEST_HARMONIC + 1, HIGHEST_HARMONIC + 3)
"""Odd coefficients that change sign when a circle is mirrored about the axis through its start: sines of one and three undulations."""


def across(one: Seen) -> Floats:
    """Return the coefficients off the axis, shape (2,) [µm]."""
    return one.coefficients_um[list(ACROSS)]
