"""The result of `history`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from dbbstation.computing.grouped import grouped
from dbbstation.facts import of_facts, picked
from dbbstation.facts.serialise import Kept
from dbbstation.facts.value import finite
from dbbstation.history.standardised import BASELINE
from dbbstation.history.watch import DECIDED_BY, TrendEvent
from dbbstation.quality.conformity import Size, conformity
from dbbstation.results.frame import Framed

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dbbstation.history.record import SessionFigures
    from dbbstation.history.trend import MachineHistory, Trend, TrendOptions


@dataclass(frozen=True)
class HistorySession:
    """One session of a history.

    Attributes:
        started: first accepted run, ISO 8601.
    """

    name: str
    started: str | None
    sha256: str

    @property
    def date(self) -> str:
        """Return the day of its start."""
        return (self.started or "")[:10]


@dataclass(frozen=True)
class ChangedQuantity:
    """Change of a quantity."""

    quantity: str
    difference: float
    u_difference: float
    unit: str


@dataclass(frozen=True)
class HistoryChange:
    """Changes of a machine since one session.

    Attributes:
        beside: other changes of that session, in words.
    """

    verdict: str
    since: HistorySession
    found: HistorySession
    beside: tuple[str, ...]
    quantities: tuple[ChangedQuantity, ...]


@dataclass(frozen=True)
class HistoryValue:
    """One quantity in one session, with the values of the chart; None if not watched.

    Attributes:
        z: standardised value, standard normal if nothing changed.
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
        figure: such as `G`, or a parameter.
        of: circle in words, or a parameter's error source.
        why_not: None if watched.
        limit: greatest size by the shop's tolerances.
        conformity: of the last value [ISO 14253-1].
        exceeded_sessions: number of sessions beyond the limit by more than U.
        scatter_in_u: scatter since the last change, in stated uncertainties.
        decided_by: `stated-uncertainty` or `control-chart`, or None.
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
    events: tuple[TrendEvent[str], ...]
    values: tuple[HistoryValue, ...]


@dataclass(frozen=True)
class WatchLimits:
    """Limits of every quantity, in standard deviations."""

    reference: float
    decision_interval: float
    single_limit: float


@dataclass(frozen=True)
class MachineHistoryResult:
    """Sessions and quantities of one machine.

    Attributes:
        false_alarms_expected: number over this history if nothing changes.
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
    """An unusable session or model."""

    name: str
    problem: str


@dataclass(frozen=True, kw_only=True)
class HistoryResult(Framed):
    """Histories of the machines with sessions in a folder.

    Attributes:
        false_alarms_per_session: over all quantities of a machine.
        worked_out: sessions and models computed now, not read from the index.
        model_warnings: of each session's model, by session; `remarks` begin with them.
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
        """Return one row per machine, quantity and session; None for missing values."""
        of_quantity = ("quantity", "figure", "test", "direction", "of", "unit")
        charted = ("level", "z", "cusum_high", "cusum_low")
        return [
            {
                "machine": machine.machine,
                **picked(one, *of_quantity),
                **picked(value, "session", "started", "value", "u"),
                "limit": one.limit,
                **picked(value, *charted),
                "event": next((event.verdict for event in one.events if event.found == value.session), None),
                "model_warning": "; ".join(self.model_warnings.get(value.session, ())) if one.test is None else None,
            }
            for machine in self.machines
            for one in machine.quantities
            for value in one.values
        ]


FIGURES = {
    "G": "circular deviation, readings up to 30 undulations per revolution [ISO 230-4]",
    "X": "centre less the commanded one, along X",
    "Y": "centre less the commanded one, along Y",
    "R": "mean length of the bar less its nominal one",
    "C": "distance of the centre from the commanded one",
}
"""Meaning of the figures of circles."""


def history_result(
    machines: Sequence[MachineHistory],
    asked: TrendOptions,
    left_out: Sequence[tuple[str, str]] = (),
    remarks: Sequence[str] = (),
    worked_out: int = 0,
    model_warnings: Mapping[str, tuple[str, ...]] | None = None,
) -> HistoryResult:
    """Return histories as a result."""
    return HistoryResult(
        coverage_factor=asked.coverage_factor,
        false_alarms_per_session=asked.false_alarms,
        baseline_sessions=BASELINE,
        figures=FIGURES,
        machines=tuple(_machine(one, asked.coverage_factor) for one in machines),
        left_out=tuple(LeftOut(name, problem) for name, problem in left_out),
        remarks=tuple(remarks),
        worked_out=worked_out,
        model_warnings=model_warnings or {},
    )


def _machine(one: MachineHistory, coverage_factor: float) -> MachineHistoryResult:
    sessions = [
        HistorySession(session.name, None if session.started is None else session.started.isoformat(), session.sha256)
        for session in one.sessions
    ]
    chart = one.chart
    return MachineHistoryResult(
        machine=one.machine,
        sessions=tuple(sessions),
        watched_quantities=sum(not trend.why_not for trend in one.trends),
        chart=None if chart is None else WatchLimits(chart.reference, chart.interval, chart.single),
        false_alarms_expected=one.expected,
        verdicts=dict(sorted(Counter(str(trend.watched.verdict) for trend in one.trends).items())),
        changes=tuple(_changes(one, sessions)),
        quantities=tuple(_quantity(trend, sessions, coverage_factor) for trend in one.trends),
    )


def _changes(one: MachineHistory, sessions: Sequence[HistorySession]) -> Iterator[HistoryChange]:
    found = grouped(
        ((int(trend.at[event.found]), int(trend.at[event.since]), event.verdict), (trend, event))
        for trend in one.trends
        for event in trend.watched.events
    )
    for (shown, since, verdict), events in sorted(found.items()):
        sizes = sorted(events, key=lambda pair: -abs(pair[1].difference) / pair[1].u_difference)
        yield HistoryChange(
            verdict=str(verdict),
            since=sessions[since],
            found=sessions[shown],
            beside=tuple(_beside(one.sessions, since)),
            quantities=tuple(
                ChangedQuantity(trend.label, event.difference, event.u_difference, trend.subject.unit)
                for trend, event in sizes
            ),
        )


def _beside(sessions: Sequence[SessionFigures], since: int) -> Iterator[str]:
    if not since:
        return
    before, after = sessions[since - 1], sessions[since]
    if before.bar != after.bar:
        yield f"another bar, {after.bar or 'not noted'} after {before.bar or 'not noted'}"
    if before.programs != after.programs:
        yield (
            "other programs"
            if after.programs and before.programs
            else ("compensated programs from here" if after.programs else "programs of the plan from here")
        )


def _quantity(trend: Trend, sessions: Sequence[HistorySession], coverage_factor: float) -> QuantityHistory:
    watched, limit = trend.watched, trend.limit
    last = Size(abs(float(trend.values[-1])), float(np.nan_to_num(trend.u[-1])))
    beyond = np.abs(trend.values) - coverage_factor * np.nan_to_num(trend.u)
    return of_facts(
        QuantityHistory,
        trend.subject,
        quantity=trend.label,
        test=trend.subject.test or None,
        direction=trend.subject.direction or None,
        verdict=str(watched.verdict),
        why_not=trend.why_not or None,
        limit=limit,
        conformity=None if limit is None else str(conformity(last, limit, coverage_factor)),
        exceeded_sessions=None if limit is None else int(np.sum(beyond > limit)),
        level=finite(float(watched.level[-1])),
        u_level=finite(float(watched.u_level[-1])),
        scatter_in_u=finite(watched.scatter),
        sessions_lacking=watched.lacking,
        decided_by=DECIDED_BY[watched.by_stated] if watched.watched else None,
        watched_sessions=watched.watched,
        events=tuple(event.named([sessions[at].name for at in trend.at]) for event in watched.events),
        values=tuple(_values(trend, sessions)),
    )


def _values(trend: Trend, sessions: Sequence[HistorySession]) -> Iterator[HistoryValue]:
    watched = trend.watched
    columns = (trend.at, trend.values, trend.u, watched.level, watched.z, watched.high, watched.low)
    for k, value, *others in zip(*(column.tolist() for column in columns), strict=True):
        yield HistoryValue(sessions[k].name, sessions[k].started, value, *map(finite, others))
