"""Make the result of histories."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.facts.value import finite
from dbbstation.history.standardised import BASELINE
from dbbstation.history.watch import DECIDED_BY
from dbbstation.quality.conformity import Size, conformity
from dbbstation.results.history import (
    ChangedQuantity,
    HistoryChange,
    HistoryResult,
    HistorySession,
    HistoryValue,
    LeftOut,
    MachineHistoryResult,
    QuantityHistory,
    WatchLimits,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from dbbstation.history.record import SessionFigures
    from dbbstation.history.trend import MachineHistory, Trend, TrendOptions
    from dbbstation.history.watch import TrendEvent, TrendVerdict

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
    sessions = [_session(session) for session in one.sessions]
    chart = one.chart
    return MachineHistoryResult(
        machine=one.machine,
        sessions=tuple(sessions),
        watched_quantities=sum(trend.watched is not None for trend in one.trends),
        chart=None if chart is None else WatchLimits(chart.reference, chart.interval, chart.single),
        false_alarms_expected=one.expected,
        verdicts={str(verdict): count for verdict, count in sorted(Counter(t.verdict for t in one.trends).items())},
        changes=tuple(_changes(one, sessions)),
        quantities=tuple(_quantity(trend, sessions, coverage_factor) for trend in one.trends),
    )


def _session(session: SessionFigures) -> HistorySession:
    started = None if session.started is None else session.started.isoformat()
    return HistorySession(session.name, started, session.sha256)


def _changes(one: MachineHistory, sessions: Sequence[HistorySession]) -> Iterator[HistoryChange]:
    found: dict[tuple[int, int, TrendVerdict], list[tuple[Trend, TrendEvent[int]]]] = {}
    for trend in one.trends:
        for event in () if trend.watched is None else trend.watched.events:
            key = (int(trend.at[event.found]), int(trend.at[event.since]), event.verdict)
            found.setdefault(key, []).append((trend, event))
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
    return QuantityHistory(
        quantity=trend.label,
        figure=trend.subject.figure,
        test=trend.subject.test or None,
        direction=trend.subject.direction or None,
        of=trend.subject.of,
        unit=trend.subject.unit,
        verdict=str(trend.verdict),
        why_not=trend.why_not or None,
        limit=limit,
        conformity=None if limit is None else str(conformity(last, limit, coverage_factor)),
        exceeded_sessions=None if limit is None else int(np.sum(beyond > limit)),
        level=None if watched is None else finite(float(watched.level[-1])),
        u_level=None if watched is None else finite(float(watched.u_level[-1])),
        scatter_in_u=None if watched is None else finite(watched.scatter),
        sessions_lacking=None if watched is None else watched.lacking,
        decided_by=None if watched is None or not watched.watched else DECIDED_BY[watched.by_stated],
        watched_sessions=0 if watched is None else watched.watched,
        events=()
        if watched is None
        else tuple(event.named([sessions[at].name for at in trend.at]) for event in watched.events),
        values=tuple(_values(trend, sessions)),
    )


def _values(trend: Trend, sessions: Sequence[HistorySession]) -> Iterator[HistoryValue]:
    watched = trend.watched
    unknown = np.full(len(trend.at), np.nan)
    charted = [unknown] * 4 if watched is None else [watched.level, watched.z, watched.high, watched.low]
    columns = (trend.at, trend.values, trend.u, *charted)
    for k, value, *others in zip(*(column.tolist() for column in columns), strict=True):
        yield HistoryValue(sessions[k].name, sessions[k].started, value, *map(finite, others))
