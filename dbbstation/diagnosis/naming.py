"""Naming: which sources together explain the recordings best, and which balls only stand off their place."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from dbbstation.calibration.fit import SMALLEST_NOISE_MM, Calibration, calibrate, default_sources
from dbbstation.calibration.outliers import Outlier, calibrate_robust
from dbbstation.diagnosis.channel import Channel, channel_of
from dbbstation.diagnosis.refit import refitted
from dbbstation.errors import CalibrationError
from dbbstation.inference.harmonics import Misfit, misfit
from dbbstation.inference.race import Choice, Race, select, worth_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource

THRESHOLD = 6.0
"""Log evidence that a source must bring: odds of 400 to 1 for it."""

MOST_SOURCES = 4
MOST_ROUNDS = 6
"""Times that naming and noise may settle against each other."""

BY_CHANCE = 6e-5
"""Chance below which amplitudes stand out in the exact fit: four standard deviations of a single one."""

HELD = 1e-12
"""Share of the greatest variance below which a direction was held, not fitted."""

COST_OF_A_BALL = 14.0
"""What a ball off its place must explain, in units of log evidence: two coordinates, and that it happens at all."""

COST_OF_AN_AMPLITUDE = 2.5
"""The same for an amplitude of a source, about the logarithm of its plausible size over its uncertainty."""


@dataclass(frozen=True, eq=False)
class Round:
    """One round of naming: a joint fit, its noise, and the race that was run with that noise."""

    chosen: tuple[Choice, ...]
    after: Calibration
    left: Misfit
    race: Race


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
    sources: dict[str, ErrorSource],
    progress: Callable[[str], None],
) -> Look:
    """Name what is missing, with and without balls off their place, and return the simpler story.

    Both can stand in for each other: tests that show missing physics for the first time look like badly seated balls,
    and a badly seated ball looks like a warped plate.
    """
    progress("kinematic calibration")
    robust = calibrate_robust(partial(calibrate, machine), runs)
    if not robust[1]:
        return _beside(_look(*robust, sources, progress), runs, sources, progress)
    plain = calibrate_robust(partial(calibrate, machine), runs, balls=False)
    first = _beside(_look(*plain, sources, progress), runs, sources, progress)
    if len(robust[1]) == len(plain[1]):
        return first
    second = _look(*robust, sources, progress)
    noise = min(first.settled.left.noise, second.settled.left.noise)
    return min((first, second), key=lambda look: look.cost(noise))


def _look(
    before: Calibration,
    outliers: tuple[Outlier, ...],
    sources: dict[str, ErrorSource],
    progress: Callable[[str], None],
) -> Look:
    progress("candidates")
    channel = channel_of(before, list(sources.values()))
    first = misfit_of(before)
    return Look(before, outliers, channel, first, _settle(channel, before, first, sources, progress))


def _beside(
    look: Look, runs: Sequence[Observation], sources: dict[str, ErrorSource], progress: Callable[[str], None]
) -> Look:
    """Look again where balls stand out beside the joint model that did not beside the base: physics had hidden them."""
    if not look.settled.chosen:
        return look
    again, outliers = calibrate_robust(partial(refitted, look.settled.after), runs)
    if {(o.kind, o.run) for o in outliers} == {(o.kind, o.run) for o in look.outliers}:
        return look
    other = _look(calibrate(look.channel.machine, again.observations), outliers, sources, progress)
    noise = min(look.settled.left.noise, other.settled.left.noise)
    return min((look, other), key=lambda one: one.cost(noise))


def misfit_of(calibration: Calibration) -> Misfit:
    """Misfit of what a fit leaves; where the balls stand in each mounting does not count."""
    fitted = int(np.count_nonzero(~calibration.layout.known.random)) - len(calibration.solution.held)
    # Angles from +X, so that both directions of a mounting have one first harmonic.
    phases = [np.radians(o.raw.theta_deg) for o in calibration.observations]
    groups = [o.setup.mounting for o in calibration.observations]
    return misfit(calibration.residual_mm, phases, groups, fitted)


def _settle(
    channel: Channel,
    before: Calibration,
    first: Misfit,
    sources: dict[str, ErrorSource],
    progress: Callable[[str], None],
) -> Round:
    """Name, fit jointly, drop what the exact fit does not need, read the noise anew, until the names stay.

    The race knows shape parameters at the points of their grids only. Beside a strong source whose time constant
    falls between two points, a second one may seem to be needed; the exact fit then finds no amplitude for it.
    """
    dropped: set[str] = set()
    best = Round((), before, first, channel.race(first.noise))
    for _ in range(MOST_ROUNDS):
        race = channel.race(best.left.noise)
        candidates = [candidate for candidate in channel.named if candidate.name not in dropped]
        chosen = select(race, candidates, THRESHOLD, MOST_SOURCES)
        found = {choice.candidate.name for choice in chosen}
        if found == {choice.candidate.name for choice in best.chosen}:
            break
        progress("joint fit with " + (", ".join(sorted(found)) or "nothing more"))
        try:
            after = _joint(channel, race, chosen, sources) if chosen else before
        except CalibrationError:
            # An amplitude of next to nothing leaves the time constant beside it without a hold.
            dropped.add(min(chosen, key=lambda one: worth_of(race, chosen, one)).candidate.name)
            continue
        weak = {name for name in found if not _stands_out(after, name)}
        left = misfit_of(after)
        if weak:
            dropped |= weak
            best = replace(best, left=left)
        else:
            best = Round(tuple(chosen), after, left, race)
    # Names, fit and what is left of it belong together, whatever ended the rounds.
    left = misfit_of(best.after)
    return replace(best, left=left, race=channel.race(left.noise))


def _stands_out(calibration: Calibration, name: str) -> bool:
    """Whether amplitudes of a source, in any of their combinations, stand out of their covariance in an exact fit."""
    columns = np.array(
        [
            term.columns.start + k
            for term in calibration.layout.terms
            if term.source.name == name
            for k, parameter in enumerate(term.parameters)
            if not parameter.shape
        ]
    )
    scale = calibration.layout.known.scale[columns]
    covariance = calibration.solution.covariance[np.ix_(columns, columns)] / np.outer(scale, scale)
    variance, axes = np.linalg.eigh(covariance)
    free = variance > HELD * variance.max(initial=0.0)  # directions that were held have none
    along = (axes.T @ (calibration.x[columns] / scale))[free]
    return float(np.sum(along**2 / variance[free])) > float(chdtri(max(int(free.sum()), 1), BY_CHANCE))


def _joint(channel: Channel, race: Race, chosen: Sequence[Choice], sources: dict[str, ErrorSource]) -> Calibration:
    """Fit base and chosen sources together, exactly, from the amplitudes that the race found."""
    amplitudes = race.amplitudes([choice.variant for choice in chosen]).values
    start: dict[str, NDArray[np.float64]] = {}
    for choice in chosen:
        source = sources[choice.candidate.name]
        count = len(choice.variant.columns)
        start[source.name] = _with_shape(source, channel.machine, amplitudes[:count], choice.variant.shape)
        amplitudes = amplitudes[count:]
    more = [sources[choice.candidate.name] for choice in chosen]
    return calibrate(channel.machine, channel.observations, [*default_sources(), *more], start)


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
