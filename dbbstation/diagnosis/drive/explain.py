"""Find the most probable set of causes with possible mass and friction."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from dbbstation.diagnosis.drive.channel import MASS, VISCOUS, drive_channel
from dbbstation.diagnosis.drive.fit import DriveFit, fit, log_possible, measured
from dbbstation.inference.bounds import BOUNDS, DRIVES
from dbbstation.inference.hypotheses import LIKELY, Posterior
from dbbstation.inference.settle import settle

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from dbbstation.diagnosis.drive.channel import DriveChannel
    from dbbstation.diagnosis.drive.recordings import Recordings
    from dbbstation.inference.settled import Settled
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
        if after.impossible and number < DRIVES.rounds - 1 and len(base) > 1:
            name = after.impossible[0]
            value = after.base[name]
            dropped[name] = (
                f"{name} would come out at {value.in_words}, which cannot be, and is left out: {POINTS_TO[name]}"
            )
            continue
        break
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
        if hypothesis.log_posterior < top - LIKELY:
            break  # all further hypotheses are improbable
        less = log_possible(fit(drive, settled, hypothesis.members))
        hypotheses[number] = replace(hypothesis, log_posterior=hypothesis.log_posterior + less)
        weights[hypothesis.names] = hypotheses[number].log_posterior
        top = max(top, hypotheses[number].log_posterior)
    found = Posterior(tuple(sorted(hypotheses, key=lambda h: -h.log_posterior)), weights)
    return replace(settled, posterior=found)
