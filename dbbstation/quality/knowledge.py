"""What is known before a run is judged, as plain numbers: where its circle should lie, and what other runs of its session show."""

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

    from dbbstation.plan.circle import Circle
    from dbbstation.trace.recording import Recording

HIGHEST_HARMONIC = 3
"""Undulations per revolution up to which runs are compared: mean, centre, ellipse and triangle are what a wrong ball, bar, tilt
or direction changes, and seven numbers of thousands of samples are known to hundredths of a micrometre."""

LOCAL_HARMONIC = 29
"""Undulations per revolution up to which runs are compared for what happened at one place: below those that noise is read from."""

LOCAL_COEFFICIENTS = 2 * LOCAL_HARMONIC + 1
"""Numbers of a form of so many undulations, as of `local_columns`."""


def local_columns(theta_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what a reading is per orthonormal coefficient of a form with `LOCAL_HARMONIC` undulations, shape (n, 59).

    Args:
        theta_rad: commanded angles from +X towards +Y, shape (n,) [rad].
    """
    angles = np.outer(theta_rad, np.arange(1, LOCAL_HARMONIC + 1))
    return np.hstack([np.ones((len(theta_rad), 1)), np.sqrt(2.0) * np.cos(angles), np.sqrt(2.0) * np.sin(angles)])


COEFFICIENTS = 2 * HIGHEST_HARMONIC + 1
"""Numbers of a form: its mean, and a cosine and a sine of each harmonic."""

HIGHER = (2, 3, 5, 6)
"""Those of two and three undulations, which no shift of a ball and no length of a bar makes."""


def form_columns(theta_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what a reading is per orthonormal coefficient of its form, shape (n, 7).

    Args:
        theta_rad: commanded angles from the start of the turn towards +Y, shape (n,) [rad].
    """
    angles = np.outer(theta_rad, np.arange(1, HIGHEST_HARMONIC + 1))
    return np.hstack([np.ones((len(theta_rad), 1)), np.sqrt(2.0) * np.cos(angles), np.sqrt(2.0) * np.sin(angles)])


def along_travel(circle: Circle) -> NDArray[np.float64]:
    """Return the signs that coefficients take when angles are counted along the travel in place of towards +Y, shape (7,)."""
    return np.concatenate([np.ones(HIGHEST_HARMONIC + 1), np.full(HIGHEST_HARMONIC, circle.direction.sign)])


@dataclass(frozen=True, eq=False)
class Expected:
    """Where a circle should lie, by the nominal machine or by a model.

    Attributes:
        centre_mm: X and Y of the centre less the commanded one, shape (2,) [mm].
        radial_mm: mean reading less nominal length of the bar [mm].
        covariance_mm2: of these three numbers, ball, mounting and bar included, shape (3, 3) [mm²].
        place_known: False for a ball put up under the spindle: its centre says nothing.
        mounting_mm: standard deviation of where a ball comes to lie when it is put up again, in X and in Y [mm].
        reversals_deg: angles from +X at which a strut turns round [deg].
        form_um: expected coefficients, as of `Seen.coefficients_um`, shape (7,) [µm].
        effects_um: what one standard deviation of each cause's parameters does to these coefficients, shape (7, p) each, by the
            cause and the set of values that it shares with other runs [µm].
        local_um: the same of causes that act along a path or with time, on the coefficients of `local_columns`, shape (59, p) each [µm].
        moving: keys of the causes that act where the machine moves, and not where it stands.
        again_um2: covariance of the difference of two runs of this circle, each on a mounting of its own, shape (7, 7) [µm²].
        place_um: standard deviation of the ball's place that the plan states, CMM and holder, per axis [µm].
        known_um2: covariance of a sound run's form, noise included, where other tests say what the machine is like, shape (7, 7)
            [µm²]; None where they do not.
    """

    centre_mm: NDArray[np.float64]
    radial_mm: float
    covariance_mm2: NDArray[np.float64]
    place_known: bool = True
    mounting_mm: float = 0.0
    reversals_deg: tuple[float, ...] = ()
    form_um: NDArray[np.float64] = field(default_factory=lambda: np.zeros(COEFFICIENTS))
    effects_um: Mapping[tuple[str, str], NDArray[np.float64]] = field(default_factory=dict)
    local_um: Mapping[tuple[str, str], NDArray[np.float64]] = field(default_factory=dict)
    moving: frozenset[tuple[str, str]] = frozenset()
    again_um2: NDArray[np.float64] = field(default_factory=lambda: np.zeros((COEFFICIENTS, COEFFICIENTS)))
    place_um: float = 0.0
    known_um2: NDArray[np.float64] | None = None


@dataclass(frozen=True, eq=False)
class Planned:
    """A circle of the plan, and what a model says that it looks like."""

    test: str
    circle: Circle
    expected: Expected

    @property
    def label(self) -> str:
        """Name in texts."""
        return f"{self.test} {self.circle.direction}"


@dataclass(frozen=True, eq=False)
class Run:
    """One run as it is judged.

    Attributes:
        repeat: counts the runs of this test and direction.
        mounting: name of the putting-up of its ball; runs that share it share the place of the ball.
        expected: where its circle should lie; None where nobody knows.
        largest_loss_percent: share of samples that may be lost [%].
        planned: all circles of its plan, where a model says what they look like.
        started_s: when it began, on the clock of its session [s]; None where not noted.
        usual: where it should lie by the usual sizes of all causes, where `expected` is by a model; None without a model.
        bar_stated: whether the session states a calibrated length of the bar.
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
        """Name in texts."""
        return f"{self.test} {self.circle.direction} {self.repeat}"


@dataclass(frozen=True, eq=False)
class Seen:
    """A run with what was worked out of it once.

    Attributes:
        analysis: its figures; None where it shows no circle.
        problem: why it shows none; empty where it does.
        lost: samples missing on the turn, and there.
        unusable: of the missing ones, how many are recorded but cannot be used.
        feed_mm_min: feed that its overlap shows and its standard uncertainty [mm/min]; None where it shows none.
        longer_s: by how much the way from feed-in to feed-out took longer than its length at the programmed feed; None where one
            of them is missing or angles were recorded [s].
        coefficients_um: orthonormal Fourier coefficients of the readings less the bar's length, harmonics 0 to 3 by commanded
            angle from the start of the turn towards +Y: mean, cosines, sines, shape (7,) [µm].
        local_um: the same up to `LOCAL_HARMONIC` undulations, as of `local_columns`, shape (59,) [µm]; zeros where samples are
            too few.
        ways: feed-in and feed-out by the readings; None where they are not in the recording.
    """

    run: Run
    analysis: CircleAnalysis | None
    problem: str
    lost: tuple[int, int]
    feed_mm_min: tuple[float, float] | None = None
    longer_s: float | None = None
    coefficients_um: NDArray[np.float64] = field(default_factory=lambda: np.zeros(COEFFICIENTS))
    unusable: int = 0
    local_um: NDArray[np.float64] = field(default_factory=lambda: np.zeros(LOCAL_COEFFICIENTS))
    ways: tuple[FeedingWay, FeedingWay] | None = None

    @cached_property
    def without_model(self) -> Seen:
        """The same run, of whose circle no model says anything; itself where none does."""
        if self.run.usual is None:
            return self
        return replace(self, run=replace(self.run, expected=self.run.usual, usual=None, planned=()))

    @cached_property
    def stretches(self) -> dict[int, NDArray[np.uint64]]:
        """Its stretches of readings, sorted, by their length: `copied` enters them."""
        return {}

    @cached_property
    def u_um(self) -> float:
        """Standard uncertainty of each coefficient by noise [µm]."""
        if self.analysis is None:
            return 0.0
        return self.analysis.noise.sigma_um / float(np.sqrt(len(self.analysis.raw)))

    @cached_property
    def drift_um_s(self) -> float:
        """How fast the bar's reading of one place grows, by the overlap; zero where it has none [µm/s]."""
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
    theta = np.radians(raw.theta_deg - raw.circle.start_deg)
    long_um = 1e3 * (raw.length_mm - raw.circle.bar_mm)
    found = amplitudes(long_um, theta, HIGHEST_HARMONIC)
    orthonormal = _orthonormal(found)
    local = np.zeros(LOCAL_COEFFICIENTS)
    if len(raw) > SAMPLES_PER_HARMONIC * LOCAL_HARMONIC:
        local = _orthonormal(amplitudes(long_um, np.radians(raw.theta_deg), LOCAL_HARMONIC))
    return Seen(run, analysis, "", lost, analysis.feed_mm_min, _longer_s(run), orthonormal, unusable, local, _ways(run))


def _orthonormal(found: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Coefficients of a form from its harmonics: mean, cosines, sines."""
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
    """Return how long the way from the middle of the feed-in to that of the feed-out takes at the programmed feed [s]."""
    return circle.swept_deg / circle.turning_deg_s + circle.feed_in_mm / (circle.feed_mm_min / 60.0)


@dataclass(frozen=True, eq=False)
class Others:
    """What the other runs of a session show, and which of them belong to this one.

    Attributes:
        longer_s: by how much each took longer than due [s].
        directions_um: root mean square of the difference of both directions, of each other circle, likewise [µm].
        directions_stated: how far both directions of each other circle differ, in standard deviations of what is stated.
        across_um: difference of both directions, of each other circle, off the axis through the start of the turn [µm].
        local_um: root mean square by which both directions of each other circle differ at places [µm].
        opposite: same test in the other direction, on the same mounting where there is one; None where there is none.
        earlier: same test and direction, the repeat before; None where there is none.
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
    """Root mean square of the difference of two runs up to three undulations, and each coefficient's uncertainty [µm]."""
    return float(np.linalg.norm(one.coefficients_um - other.coefficients_um)), float(np.hypot(one.u_um, other.u_um))


ACROSS = (HIGHEST_HARMONIC + 1, HIGHEST_HARMONIC + 3)
"""Odd coefficients that change sign when a circle is mirrored about the axis through its start: sines of one and three undulations."""


def across(one: Seen) -> NDArray[np.float64]:
    """Those coefficients, shape (2,) [µm]."""
    return one.coefficients_um[list(ACROSS)]
