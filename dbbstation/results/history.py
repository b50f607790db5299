"""Histories of machines over their sessions: the result of `history`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from pydantic import Field

from dbbstation.facts.serialise import Kept
from dbbstation.results.frame import Framed


@dataclass(frozen=True)
class HistorySession:
    """One session of a history.

    Attributes:
        name: of its folder, from the folder of the history.
        started: start of its first accepted run, ISO 8601.
    """

    name: str
    started: str | None
    sha256: str

    @property
    def date(self) -> str:
        """Day on which it was started."""
        return (self.started or "")[:10]


@dataclass(frozen=True)
class ChangedQuantity:
    """By how much a quantity changed."""

    quantity: str
    difference: float
    u_difference: float
    unit: str


@dataclass(frozen=True)
class HistoryChange:
    """What changed on a machine from one session on.

    Attributes:
        beside: what else is new in that session, in words.
    """

    verdict: str
    since: HistorySession
    found: HistorySession
    beside: tuple[str, ...]
    quantities: tuple[ChangedQuantity, ...]


@dataclass(frozen=True)
class HistoryEvent:
    """Something beyond scatter and uncertainty of one quantity.

    Attributes:
        verdict: `changed` or `stands out`.
        since: name of the session from which it is so.
        found: name of the session that showed it.
        decided_by: `stated-uncertainty` or `control-chart`.
    """

    verdict: str
    since: str
    found: str
    difference: float
    u_difference: float
    decided_by: str


@dataclass(frozen=True)
class HistoryValue:
    """One quantity in one session, with what the chart made of it; None where it was not watched.

    Attributes:
        started: start of the session, ISO 8601.
        value: mean over the runs of the session, in the quantity's unit.
        u: its standard uncertainty; None where not known.
        z: standard normal where nothing changes.
        cusum_high: cumulative sum upwards.
        cusum_low: cumulative sum downwards.
    """

    session: str
    started: str | None
    value: float
    u: float | None
    level: float | None
    z: float | None
    cusum_high: float | None
    cusum_low: float | None


@dataclass(frozen=True)
class QuantityHistory:
    """One quantity of one machine over its sessions.

    Attributes:
        quantity: in words; no other of the machine has the same.
        figure: such as `G`; name of a parameter.
        test: name of the test; None for a parameter.
        direction: `ccw` or `cw`; None for a parameter.
        of: circle in words; of a parameter its error source.
        why_not: why it is not watched; None where it is.
        limit: greatest size by the shop's tolerances; None where there is none.
        conformity: of the last value with that limit [ISO 14253-1].
        exceeded_sessions: how many are beyond it by more than U.
        level: of the last stretch.
        scatter_in_u: scatter of the last stretch, in stated uncertainties.
        sessions_lacking: sessions that are needed until the next one can be held against those before.
        decided_by: `stated-uncertainty` or `control-chart`; None where nothing was decided.
        events: in time order.
        values: in time order.
    """

    quantity: str
    figure: str
    test: str | None
    direction: str | None
    of: str
    unit: str
    verdict: str
    why_not: str | None
    limit: float | None
    conformity: str | None
    exceeded_sessions: int | None
    level: float | None
    u_level: float | None
    scatter_in_u: float | None
    sessions_lacking: int | None
    decided_by: str | None
    watched_sessions: int
    events: tuple[HistoryEvent, ...]
    values: tuple[HistoryValue, ...]


@dataclass(frozen=True)
class WatchLimits:
    """Limits that each quantity is watched with, in standard deviations.

    Attributes:
        reference: what a cumulative sum loses with each session.
        single_limit: size from which a single session stands out.
    """

    reference: float
    decision_interval: float
    single_limit: float


@dataclass(frozen=True)
class MachineHistoryResult:
    """Sessions and quantities of one machine.

    Attributes:
        machine: serial number or name.
        sessions: in time order.
        false_alarms_expected: over this history if nothing changed.
        quantities: circles first, in the order of tests, then parameters.
    """

    machine: str
    sessions: tuple[HistorySession, ...]
    watched_quantities: int
    chart: WatchLimits | None
    false_alarms_expected: float
    verdicts: Mapping[str, int]
    changes: tuple[HistoryChange, ...]
    quantities: tuple[QuantityHistory, ...]


@dataclass(frozen=True)
class LeftOut:
    """A session or model that could not be used.

    Attributes:
        name: of its folder or file.
    """

    name: str
    problem: str


@dataclass(frozen=True, kw_only=True)
class HistoryResult(Framed):
    """Histories of the machines whose sessions lie in a folder.

    Attributes:
        false_alarms_per_session: that the limits are made for, all quantities of a machine together.
        figures: what the figures of circles mean.
        worked_out: sessions and models that were read now; the others came from the index.
        model_warnings: what has to be said of the model of each session, by the session's name; `remarks` begin with it.
    """

    coverage_factor: float
    false_alarms_per_session: float
    baseline_sessions: int
    figures: Mapping[str, str]
    machines: tuple[MachineHistoryResult, ...]
    left_out: tuple[LeftOut, ...]
    remarks: Annotated[tuple[str, ...], Field(serialization_alias="notes")]
    worked_out: Annotated[int, Kept] = 0
    model_warnings: Annotated[Mapping[str, tuple[str, ...]], Kept] = field(default_factory=dict)

    def rows(self) -> list[dict[str, object]]:
        """One row for each machine, quantity and session, None where there is nothing."""
        return [
            {
                "machine": machine.machine,
                "quantity": one.quantity,
                "figure": one.figure,
                "test": one.test,
                "direction": one.direction,
                "of": one.of,
                "unit": one.unit,
                "session": value.session,
                "started": value.started,
                "value": value.value,
                "u": value.u,
                "limit": one.limit,
                "level": value.level,
                "z": value.z,
                "cusum_high": value.cusum_high,
                "cusum_low": value.cusum_low,
                "event": next((event.verdict for event in one.events if event.found == value.session), None),
                "model_warning": "; ".join(self.model_warnings.get(value.session, ())) if one.test is None else None,
            }
            for machine in self.machines
            for one in machine.quantities
            for value in one.values
        ]
