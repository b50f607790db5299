"""Histories as plain numbers: what `--json` and `--csv` hold, and the terminal and the page show."""

from __future__ import annotations

from collections import Counter
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.history.standardised import BASELINE
from dbbstation.quality.conformity import Size, conformity

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

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
"""What the figures of circles mean."""


DECIDED_BY = {True: "stated-uncertainty", False: "control-chart"}
"""What a verdict rests on: the stated uncertainties alone, or a chart that knows how the sessions scatter."""


def history_summary(machines: Sequence[MachineHistory], asked: TrendOptions) -> dict[str, Any]:
    """Return histories as plain numbers; None where something is not known.

    Args:
        machines: their histories.
        asked: how they were worked out.
    """
    return {
        "coverage_factor": asked.coverage_factor,
        "false_alarms_per_session": asked.false_alarms,
        "baseline_sessions": BASELINE,
        "figures": FIGURES,
        "machines": [_machine(one, asked.coverage_factor) for one in machines],
    }


def _machine(one: MachineHistory, coverage_factor: float) -> dict[str, Any]:
    sessions = [_session(session) for session in one.sessions]
    return {
        "machine": one.machine,
        "sessions": sessions,
        "watched_quantities": sum(trend.watched is not None for trend in one.trends),
        "chart": None
        if one.chart is None
        else {
            "reference": one.chart.reference,
            "decision_interval": one.chart.interval,
            "single_limit": one.chart.single,
        },
        "false_alarms_expected": one.expected,
        "verdicts": {str(verdict): count for verdict, count in sorted(Counter(t.verdict for t in one.trends).items())},
        "changes": list(_changes(one)),
        "quantities": [_trend(trend, sessions, coverage_factor) for trend in one.trends],
    }


def _session(session: SessionFigures) -> dict[str, Any]:
    return {"name": session.name, "started": _date(session), "sha256": session.sha256}


def _changes(one: MachineHistory) -> Iterator[dict[str, Any]]:
    """Yield what changed, by the session that showed it and the one from which it is so."""
    found: dict[tuple[int, int, TrendVerdict], list[tuple[Trend, TrendEvent]]] = {}
    for trend in one.trends:
        for event in () if trend.watched is None else trend.watched.events:
            key = (int(trend.at[event.found]), int(trend.at[event.since]), event.verdict)
            found.setdefault(key, []).append((trend, event))
    for (shown, since, verdict), events in sorted(found.items()):
        sizes = sorted(events, key=lambda pair: -abs(pair[1].difference) / pair[1].u_difference)
        first, last = one.sessions[since], one.sessions[shown]
        yield {
            "verdict": str(verdict),
            "since": _session(first),
            "found": _session(last),
            "beside": list(_beside(one.sessions, since)),
            "quantities": [
                {
                    "quantity": trend.label,
                    "difference": event.difference,
                    "u_difference": event.u_difference,
                    "unit": trend.subject.unit,
                }
                for trend, event in sizes
            ],
        }


def _beside(sessions: Sequence[SessionFigures], since: int) -> Iterator[str]:
    """Yield what else is new in a session, where it may be why something changed."""
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


def _trend(trend: Trend, sessions: Sequence[Mapping[str, Any]], coverage_factor: float) -> dict[str, Any]:
    watched = trend.watched
    last = Size(abs(float(trend.values[-1])), float(np.nan_to_num(trend.u[-1])))
    return {
        "quantity": trend.label,
        "figure": trend.subject.figure,
        "test": trend.subject.test or None,
        "direction": trend.subject.direction or None,
        "of": trend.subject.of,
        "unit": trend.subject.unit,
        "verdict": str(trend.verdict),
        "why_not": trend.why_not or None,
        "limit": trend.limit,
        "conformity": None if trend.limit is None else str(conformity(last, trend.limit, coverage_factor)),
        "exceeded_sessions": None
        if trend.limit is None
        else int(np.sum(np.abs(trend.values) - coverage_factor * np.nan_to_num(trend.u) > trend.limit)),
        "level": None if watched is None else _number(watched.level[-1]),
        "u_level": None if watched is None else _number(watched.u_level[-1]),
        "scatter_in_u": None if watched is None else _number(watched.scatter),
        "sessions_lacking": None if watched is None else watched.lacking,
        "decided_by": None if watched is None or not watched.watched else DECIDED_BY[watched.by_stated],
        "watched_sessions": 0 if watched is None else watched.watched,
        "events": [] if watched is None else [_event(event, trend, sessions) for event in watched.events],
        "values": _values(trend, sessions),
    }


def _event(event: TrendEvent, trend: Trend, sessions: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {
        "verdict": str(event.verdict),
        "since": sessions[trend.at[event.since]]["name"],
        "found": sessions[trend.at[event.found]]["name"],
        "difference": event.difference,
        "u_difference": event.u_difference,
        "decided_by": DECIDED_BY[event.by_stated],
    }


def _values(trend: Trend, sessions: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return every value of a trend with what the chart made of it."""
    at, watched = trend.at.tolist(), trend.watched
    columns: dict[str, list[float | None]] = {"value": trend.values.tolist(), "u": _numbers(trend.u)}
    for name in ("level", "z", "high", "low"):
        columns[name] = [None] * len(at) if watched is None else _numbers(getattr(watched, name))
    return [
        {
            "session": sessions[k]["name"],
            "started": sessions[k]["started"],
            "value": value,
            "u": u,
            "level": level,
            "z": z,
            "cusum_high": high,
            "cusum_low": low,
        }
        for k, value, u, level, z, high, low in zip(at, *columns.values(), strict=True)
    ]


def _numbers(values: NDArray[np.float64]) -> list[float | None]:
    return [value if isfinite(value) else None for value in values.tolist()]


def _date(session: SessionFigures) -> str | None:
    return None if session.started is None else session.started.isoformat()


def _number(value: float) -> float | None:
    return float(value) if isfinite(value) else None


TIDY = (
    "machine",
    "quantity",
    "figure",
    "test",
    "direction",
    "of",
    "unit",
    "session",
    "started",
    "value",
    "u",
    "limit",
    "level",
    "z",
    "cusum_high",
    "cusum_low",
    "event",
)
"""Columns of the tidy table."""


def tidy_rows(summary: dict[str, Any]) -> list[list[object]]:
    """Return one row per machine, quantity and session, under the titles of `TIDY`; empty where there is nothing."""
    rows: list[list[object]] = []
    for machine in summary["machines"]:
        for one in machine["quantities"]:
            events = {event["found"]: event["verdict"] for event in one["events"]}
            for value in one["values"]:
                row = {**one, **value, "machine": machine["machine"], "event": events.get(value["session"])}
                rows.append(["" if row[name] is None else row[name] for name in TIDY])
    return rows
