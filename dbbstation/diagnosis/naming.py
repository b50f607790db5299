"""Naming: which sources together explain the recordings best, and which balls only stand off their place."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from dbbstation.calibration.fit import SMALLEST_NOISE_MM, Calibration, calibrate, default_sources
from dbbstation.calibration.missing_physics import misfit_of
from dbbstation.calibration.outliers import MOST, calibrate_robust
from dbbstation.calibration.strange_runs import in_place_after_all
from dbbstation.calibration.stray_balls import set_free
from dbbstation.diagnosis.channel import Channel, channel_of
from dbbstation.diagnosis.unexplained import overruled
from dbbstation.errors import CalibrationError, KinematicsError
from dbbstation.inference.race import AS_GOOD, Candidate, Choice, Race, as_good, select, worth_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from dbbstation.calibration.outlier import Fit, Outlier
    from dbbstation.inference.harmonics import Misfit
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource

THRESHOLD = 4.0
"""Log evidence that a source must bring: odds of 55 to 1 for it. Of two hundred recordings of the virtual machine with nothing to
find two brought as much by chance, one of them a ball, of which more is asked."""

MOST_SOURCES = 4
MOST_ROUNDS = 6
"""Times that naming and noise may settle against each other."""

BY_CHANCE = 1e-3
"""Chance below which amplitudes stand out in the exact fit, of those that the race has already chosen."""

GRID = 0.3
"""Share to which parameters of shape are known from the grid that the race tried, about its spacing."""

HELD = 1e-12
"""Share of the greatest variance below which a direction was held, not fitted."""

COST_OF_A_BALL = 14.0
"""What a ball off its place must explain, in units of log evidence: two coordinates, and that it happens at all."""

COST_OF_AN_AMPLITUDE = 2.5
"""The same for an amplitude of a source, about the logarithm of its plausible size over its uncertainty."""


@dataclass(frozen=True, eq=False)
class Round:
    """One round of naming: a joint fit, its noise, and the race that was run with that noise.

    Attributes:
        chosen: sources that were named; balls and bars among them where one is off.
        after: fit with the sources.
        left: misfit of that.
        race: with its noise.
        off: ball or bar that is off by far more than stated; what is said of sources then does not count.
        alike: sources that would explain the recordings about as well in its place.
    """

    chosen: tuple[Choice, ...]
    after: Calibration
    left: Misfit
    race: Race
    off: Choice | None = None
    alike: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Look:
    """One story of what is wrong.

    Attributes:
        before: fit of the base model.
        outliers: balls and runs that do not belong, kept from pulling it.
        channel: about that fit.
        first: what it leaves.
        settled: sources that were named.
    """

    before: Calibration
    outliers: tuple[Outlier, ...]
    channel: Channel
    first: Misfit
    settled: Round

    def cost(self, noise_mm: float) -> float:
        """What the story leaves and what it takes to tell it, in units of log evidence; less is better."""
        after = self.settled.after
        noise = max(noise_mm, SMALLEST_NOISE_MM)
        left = sum(float(residual @ residual) for residual in after.residual_mm) / noise**2
        known = after.layout.known
        stated = float(np.sum((after.x[known.random] / known.prior[known.random]) ** 2))
        amplitudes = sum(len(choice.variant.columns) for choice in self.settled.chosen)
        return 0.5 * (left + stated) + COST_OF_A_BALL * len(self.outliers) + COST_OF_AN_AMPLITUDE * amplitudes


def best_look(
    machine: Machine,
    runs: Sequence[Observation],
    sources: Sequence[ErrorSource],
    progress: Callable[[str], None],
) -> Look:
    """Name what is missing, with and without balls that stand out of the kinematic fit, and return the simpler story.

    Both can stand in for each other: tests that show missing physics for the first time look like badly seated balls,
    and a badly seated ball looks like a warped plate. One ball or bar at a time competes with the sources themselves, and
    with errors that have no name; several that are far off are found beforehand only. Runs that were left out for being no
    circle of this machine are taken back where the physics that was found explains them.
    """
    progress("kinematic calibration")
    fit = partial(calibrate, machine)
    plain = calibrate_robust(fit, runs, balls=False)
    first = _look(fit, *plain, sources, progress)
    if first.settled.chosen:
        belonging, staying = in_place_after_all(first.settled.after, runs, plain[1])
        if len(staying) < len(plain[1]):
            return _look(fit, fit(belonging), staying, sources, progress)
    robust = calibrate_robust(fit, runs, begun=plain)
    if len(robust[1]) == len(plain[1]):
        return first
    second = _look(fit, *robust, sources, progress)
    noise = min(first.settled.left.noise, second.settled.left.noise)
    return min((first, second), key=lambda look: look.cost(noise))


def _look(
    fit: Fit,
    before: Calibration,
    outliers: tuple[Outlier, ...],
    sources: Sequence[ErrorSource],
    progress: Callable[[str], None],
) -> Look:
    """Name sources; set free what balls and bars the race needs beside them, and name again."""
    while True:
        progress("candidates")
        channel = channel_of(before, sources)
        first = misfit_of(before)
        settled = _settle(channel, before, first, progress)
        if settled.off is None:
            return Look(before, outliers, channel, first, settled)
        chosen = [choice.variant for choice in settled.chosen]
        free = len(outliers) < MOST and not overruled(before, settled.race, settled.left.noise, chosen)
        step = set_free(fit, before, settled.off.candidate.name, settled.off.variant.of) if free else None
        if step is None:
            channel = replace(channel, set_up=())
            return Look(before, outliers, channel, first, _settle(channel, before, first, progress))
        outliers = (*outliers, replace(step[0], alike=settled.alike))
        before = step[2]


def _settle(
    channel: Channel,
    before: Calibration,
    first: Misfit,
    progress: Callable[[str], None],
) -> Round:
    """Name, fit jointly, drop what the exact fit does not need, read the noise anew, until the names stay.

    A ball that is off by no more than all balls scatter stays in the race, so that no source is taken in its place.

    The race knows shape parameters at the points of their grids only. Beside a strong source whose time constant
    falls between two points, a second one may seem to be needed; the exact fit then finds no amplitude for it.
    """
    dropped: set[str] = set()
    scattered: set[str] = set()
    best = Round((), before, first, channel.race(first.noise))
    for _ in range(MOST_ROUNDS):
        race = channel.race(best.left.noise)
        candidates = [candidate for candidate in channel.named if candidate.name not in dropped]
        set_up = [candidate for candidate in channel.set_up if candidate.name not in dropped]
        chosen = select(race, [*candidates, *set_up], THRESHOLD, MOST_SOURCES)
        off = [choice for choice in chosen if choice.variant.of and choice.candidate.name not in scattered]
        if off:
            worst = max(off, key=lambda one: worth_of(race, chosen, one))
            if not _beyond_scatter(race, channel.set_up, chosen, worst):
                scattered.add(worst.candidate.name)
                continue
            alike = as_good(race, chosen, worst, candidates, AS_GOOD)
            return replace(best, chosen=tuple(chosen), race=race, off=worst, alike=alike)
        # A ball that is off as far as balls here scatter is no finding, and nothing else is one in its place.
        chosen = [choice for choice in chosen if not choice.variant.of]
        found = {choice.candidate.name for choice in chosen}
        if {(c.candidate.name, c.variant.law) for c in chosen} == {
            (c.candidate.name, c.variant.law) for c in best.chosen
        }:
            break
        progress("joint fit with " + (", ".join(sorted(found)) or "nothing more"))
        try:
            after = _joint(channel, race, chosen) if chosen else before
        except (CalibrationError, KinematicsError):
            # An amplitude of next to nothing leaves the time constant beside it without a hold, and a step may leave
            # what the machine can reach.
            dropped.add(min(chosen, key=lambda one: worth_of(race, chosen, one)).candidate.name)
            continue
        weak = {choice.candidate.name for choice in chosen if not _stands_out(after, choice)}
        left = misfit_of(after)
        if weak:
            dropped |= weak
            best = replace(best, left=left)
        else:
            best = Round(tuple(chosen), after, left, race)
    # Names, fit and what is left of it belong together, whatever ended the rounds.
    left = misfit_of(best.after)
    return replace(best, left=left, race=channel.race(left.noise))


def _beyond_scatter(race: Race, set_up: Sequence[Candidate], chosen: Sequence[Choice], off: Choice) -> bool:
    """Whether a ball is off by more than all others scatter beside it: that they scatter as stated is only roughly true.

    By chance half of them lie beyond their median. One bar does not scatter.
    """
    if off.candidate.name == "bar-offset":
        return True
    others = [choice.variant for choice in chosen if choice is not off]
    beside = race.explained([*others, off.variant])
    square = beside - (race.explained(others) if others else 0.0)
    balls = [variant for candidate in set_up if candidate.name != "bar-offset" for variant in candidate.variants]
    scatter = [
        (race.explained([*others, off.variant, ball]) - beside) / float(chdtri(len(ball.columns), 0.5))
        for ball in balls
        if ball is not off.variant
    ]
    usual = max(1.0, float(np.median(scatter))) if scatter else 1.0
    return worth_of(race, chosen, off) - 0.5 * square * (1.0 - 1.0 / usual) >= THRESHOLD


def _stands_out(calibration: Calibration, choice: Choice) -> bool:
    """Whether the amplitudes that were chosen, in any of their combinations, stand out of their covariance.

    In an exact fit of all amplitudes of the source, of which the others are then said to be zero, or all to be alike. Of
    the shape that was found: where there is no amplitude there is no shape, and that one was picked is paid for.
    """
    columns, shapes = calibration.layout.columns_of(choice.candidate.name)
    known, solution = calibration.layout.known, calibration.solution
    scale = known.scale[columns]
    covariance: NDArray[np.floating] = solution.covariance[np.ix_(columns, columns)] / np.outer(scale, scale)
    if len(shapes):
        across = solution.covariance[np.ix_(columns, shapes)] / scale[:, None]
        covariance -= across @ np.linalg.pinv(solution.covariance[np.ix_(shapes, shapes)], hermitian=True) @ across.T
    values: NDArray[np.floating] = calibration.x[columns] / scale
    spread = choice.candidate.spread(choice.variant)
    if spread.shape[0] > spread.shape[1]:
        # Held directions may be anything: struts that are late by what all have in common are one that is late alone.
        held = np.zeros((len(solution.held), len(known.random)))
        held[:, ~known.random] = solution.held
        held = held[:, columns]
        weight = np.linalg.pinv(covariance + held.T @ held, rcond=HELD, hermitian=True)
        information = spread.T @ weight @ spread
        values = np.linalg.solve(information, spread.T @ weight @ values)
        covariance = np.linalg.inv(information)
    variance, axes = np.linalg.eigh(covariance)
    free = variance > HELD * variance.max(initial=0.0)  # directions that were held have none
    along = (axes.T @ values)[free]
    return float(np.sum(along**2 / variance[free])) > float(chdtri(max(int(free.sum()), 1), BY_CHANCE))


def _joint(channel: Channel, race: Race, chosen: Sequence[Choice]) -> Calibration:
    """Fit base and chosen sources together, exactly, from the amplitudes that the race found."""
    amplitudes = race.amplitudes([choice.variant for choice in chosen]).values
    start: dict[str, NDArray[np.float64]] = {}
    sources = [channel.source_of(choice.candidate.name, choice.variant) for choice in chosen]
    for choice, source in zip(chosen, sources, strict=True):
        own = len(choice.variant.columns)
        found = choice.candidate.spread(choice.variant) @ amplitudes[:own]
        start[source.name] = _with_shape(source, channel.machine, found, choice.variant.shape)
        amplitudes = amplitudes[own:]
    every = [*default_sources(), *sources]
    try:
        return calibrate(channel.machine, channel.observations, every, start)
    except CalibrationError:
        # A shape that these runs hardly see, such as a decay shorter than their samples, runs away with its amplitude.
        return calibrate(channel.machine, channel.observations, every, start, shapes_within=GRID)


def _with_shape(
    source: ErrorSource, machine: Machine, amplitudes: NDArray[np.float64], shape: tuple[float, ...]
) -> NDArray[np.float64]:
    """Parameter values from amplitudes and shape values, of the first set where there are several."""
    parameters = source.parameters(machine)
    values = np.empty(len(parameters))
    shaped = np.array([bool(p.shape) for p in parameters])
    values[shaped] = shape
    values[~shaped] = amplitudes[: int((~shaped).sum())]
    return values
