"""Find the most probable set of causes with possible mass and friction, and test and locate what it leaves."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.channel import COULOMB, MASS, VISCOUS, drive_channel, source_of
from dbbstation.diagnosis.drive.findings import ForceLocation, HeldOutForce
from dbbstation.diagnosis.drive.fit import DriveFit, fit, log_possible, measured
from dbbstation.inference.bounds import BOUNDS, DRIVES
from dbbstation.inference.folds import selections_without
from dbbstation.inference.followed import ChosenWithoutParts, left_without
from dbbstation.inference.hypotheses import Posterior
from dbbstation.inference.left_over import COUNTS_SIGMA
from dbbstation.inference.levels import Gains, is_worse
from dbbstation.inference.settle import settle
from dbbstation.inference.triangle import squares

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.diagnosis.drive.channel import DriveChannel
    from dbbstation.diagnosis.drive.recordings import Recordings
    from dbbstation.inference.coloured import Coloured
    from dbbstation.inference.settle import Settled
    from dbbstation.laws.contract import TableSource


@dataclass(frozen=True, eq=False)
class ExplainedDrive:
    """The outcome of the comparison."""

    drive: DriveChannel
    settled: Settled
    before: DriveFit
    after: DriveFit
    dropped: Mapping[str, str] = field(default_factory=dict)


def explain(recordings: Recordings, sources: Sequence[TableSource], progress: Callable[[str], None]) -> ExplainedDrive:
    """Compare sets of causes, excluding sets with impossible mass or friction."""
    dropped: dict[str, str] = {}
    for number in range(DRIVES.rounds):
        base = [name for name in (MASS, VISCOUS) if name not in dropped]
        drive = drive_channel(recordings, sources, base)
        settled = settle(
            drive.channel,
            most_expanded=DRIVES.expanded_of_table,
            most_looks=DRIVES.looks,
            rivals=False,
            progress=progress,
        )
        settled = _possible_first(drive, settled)
        after = fit(drive, settled, settled.best.members)
        if number == 0:
            first = fit(drive, settled, ())
        if not after.impossible or number == DRIVES.rounds - 1 or len(base) == 1:
            break
        name = after.impossible[0]
        value = after.base[name]
        dropped[name] = (
            f"{name} would come out at {value.in_words}, which cannot be, and is left out: {POINTS_TO[name]}"
        )
    after = measured(drive, settled, settled.best.members)
    return ExplainedDrive(drive, settled, first, after, dropped)


POINTS_TO = {
    MASS: "what the force does with the acceleration here is no inertia. It points to play or elastic parts between drive and "
    "load, or to a delay between the channels.",
    VISCOUS: "the friction falls with growing speed here. It points to Stribeck friction, or to a load that changes while "
    "the drive moves. Record at several speeds.",
}
"""Hints for a negative base parameter."""


def _possible_first(drive: DriveChannel, settled: Settled) -> Settled:
    posterior = settled.posterior
    weights = dict(posterior.weights)
    hypotheses = list(posterior.hypotheses)
    top = -float("inf")
    for number, hypothesis in enumerate(posterior.hypotheses[: BOUNDS.looked_at]):
        if hypothesis.log_posterior < top - BOUNDS.likely:
            break  # all further hypotheses are improbable
        less = log_possible(fit(drive, settled, hypothesis.members))
        hypotheses[number] = replace(hypothesis, log_posterior=hypothesis.log_posterior + less)
        weights[hypothesis.names] = hypotheses[number].log_posterior
        top = max(top, hypotheses[number].log_posterior)
    found = Posterior(tuple(sorted(hypotheses, key=lambda h: -h.log_posterior)), weights)
    return replace(settled, posterior=found)


def held_out(drive: DriveChannel, progress: Callable[[str], None]) -> tuple[HeldOutForce, ChosenWithoutParts]:
    """Hold out whole recordings if there are five, else ten stretches with gaps for the filter."""
    channel = drive.channel
    gap = GAP_PERIODS / drive.scale.cutoff_hz / drive.recordings.samples_apart_s
    choose = partial(settle, most_expanded=0, most_looks=1, thorough=False, rivals=False)
    parts = selections_without(
        channel, choose, lambda text, done, of: progress(f"{text} {done + 1} of {of}"), alike=gap
    )
    brought: dict[str, list[float]] = {source: [0.0] * len(parts) for source in drive.sources}
    reference = corrected = 0.0
    for number, part in enumerate(parts):
        settled, patterns = part.settled, part.settled.bank.patterns
        own = {name: source_of(drive, patterns, name) for name in settled.best.names}
        in_time = {name for name in own if name in patterns and "time" in [v.name for v in patterns[name].variables]}

        error = partial(_error, settled, part.rows, in_time)
        whole = error(())
        corrected += whole
        reference += error([name for name, source in own.items() if source != COULOMB])
        for source in {*own.values()} - {""}:
            brought[source][number] = error([name for name, of in own.items() if of == source]) - whole
    count = len(channel.residual)
    lengths = tuple(int(part.rows.sum()) for part in parts)
    gains = {source: Gains(tuple(each), lengths) for source, each in brought.items() if any(each)}
    errors = float(np.sqrt(reference / count)), float(np.sqrt(corrected / count))
    found = HeldOutForce(len(parts), *errors, is_worse(errors[1], errors[0]), gains)
    return found, ChosenWithoutParts(parts)


GAP_PERIODS = 0.5
"""Gap on each side of a part, in cut-off periods; beyond, the low-pass's impulse response is below a tenth."""


def _error(settled: Settled, rows: Flags, in_time: Collection[str], without: Collection[str]) -> float:
    return squares(left_without(settled, without, in_time)[rows])


SMOOTHED = 5
"""Samples averaged before the test; so many below the limit do not end a stretch."""

SLOW = 0.1
"""Share of the greatest speed below which a stretch counts as reversal or stop."""


def locate(
    recordings: Recordings, residual_n: Floats, noise: Coloured, variable: str | None
) -> tuple[ForceLocation, ...]:
    """Return stretches of a residual, shape (m,) [N], beyond noise, largest share first, and their variable."""
    smooth = np.convolve(residual_n, np.full(SMOOTHED, 1.0 / SMOOTHED), mode="same")
    together = min(noise.correlation_samples, float(SMOOTHED))
    threshold = COUNTS_SIGMA * noise.sigma * np.sqrt(together / SMOOTHED)
    total = max(float(smooth @ smooth), 1e-300)
    found: list[ForceLocation] = []
    for signals, block in zip(recordings.signals, recordings.blocks, strict=True):
        own, at = smooth[block], signals.kept
        standing = SLOW * float(np.abs(signals.speed_m_s[at]).max())
        for rows in _stretches(np.abs(own) > threshold, signals.direction[at]):
            first, last = int(at[rows[0]]), int(at[rows[-1]])
            t_s = float(signals.t_s[first]), float(signals.t_s[last])
            mm = 1e3 * float(signals.position_m[first]), 1e3 * float(signals.position_m[last])
            way = "forwards" if signals.direction[first] > 0 else "backwards"
            turns = float(np.abs(signals.speed_m_s[first : last + 1]).min()) < standing
            peak = float(own[rows][np.argmax(np.abs(own[rows]))])
            text = (
                f"{t_s[0]:.2f} to {t_s[1]:.2f} s, {mm[0]:.1f} to {mm[1]:.1f} mm {way}"
                f"{', at a reversal or stop' if turns else ''}: up to {peak:+.3g} N{f', by {variable}' if variable else ''}"
            )
            share = float(own[rows] @ own[rows]) / total
            found.append(ForceLocation(t_s, mm, way, turns, variable or None, share, peak, text))
    found.sort(key=lambda location: -location.share)
    return tuple(found[: BOUNDS.locations])


def _stretches(marked: Flags, direction: Floats) -> list[Integers]:
    rows = np.flatnonzero(marked)
    if not len(rows):
        return []
    parted = (np.diff(rows) > SMOOTHED) | (np.diff(direction[rows]) != 0.0)
    return [np.arange(part[0], part[-1] + 1) for part in np.split(rows, np.flatnonzero(parted) + 1)]
