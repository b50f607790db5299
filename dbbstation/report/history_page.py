"""Histories as one HTML file."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from dbbstation.report.history_words import changes_in_words, difference_in_words, headline, verdict_in_words
from dbbstation.report.html import environment
from dbbstation.report.polar import step_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from dbbstation.files.provenance import Provenance
    from dbbstation.history.watch import TrendEvent
    from dbbstation.results.history import HistoryResult, HistoryValue, QuantityHistory

WIDTH, HEIGHT = 560, 190
"""Size of a drawing in drawing units."""

LEFT, RIGHT, TOP, BOTTOM = 52, 10, 12, 24
"""Margins of the field for numbers and dates."""

_DIVISIONS = 2.2
"""Least number of divisions of the field's height."""

_MOST_YEARS = 12
"""Greatest number of years that are marked one by one."""

_FEW_DAYS = 400.0
"""A shorter history has dates at its ends instead of years [days]."""

_DAY_S = 86400.0


@dataclass(frozen=True)
class TrendMark:
    """A tick or an event.

    Attributes:
        at: along its axis, in drawing units.
    """

    at: float
    label: str
    kind: str = ""
    y: float = 0.0


def history_html(history: HistoryResult, provenance: Provenance, tolerances_from: str = "") -> bytes:
    """Return reproducible HTML without script and external references."""
    k = history.coverage_factor
    machines = [
        {
            "history": machine,
            "ident": f"m{number}",
            "headline": headline(machine),
            "words": list(changes_in_words(machine, k)),
            "rows": [
                (one, verdict_in_words(one), draw(one, f"m{number}q{place}", k))
                for place, one in enumerate(machine.quantities, start=1)
            ],
        }
        for number, machine in enumerate(history.machines, start=1)
    ]
    content = {
        "history": history,
        "coverage_factor": k,
        "machines": machines,
        "provenance": provenance,
        "tolerances_from": tolerances_from.replace("\\", "/").rpartition("/")[2],
        "size": (WIDTH, HEIGHT),
        "field": (LEFT, TOP, WIDTH - RIGHT, HEIGHT - BOTTOM),
    }
    return environment().get_template("history.html").render(content).encode()


def draw(one: QuantityHistory, ident: str, coverage_factor: float) -> dict[str, object]:
    """Return one quantity over time for SVG."""
    values = one.values
    days = [datetime.fromisoformat(value.started or "").timestamp() / _DAY_S for value in values]
    x = _scale(min(days), max(days), LEFT + 6.0, WIDTH - RIGHT - 6.0)
    low, high = _reach(values, coverage_factor, one.limit)
    y = _scale(low, high, HEIGHT - BOTTOM, TOP)
    at = {value.session: (x(day), y(value.value)) for day, value in zip(days, values, strict=True)}
    places = list(at.values())
    spread = [coverage_factor * (value.u or 0.0) for value in values]
    limit = one.limit
    return {
        "name": one.quantity,
        "ident": ident,
        "points": " ".join(f"M{px:.1f} {py:.1f}h0" for px, py in places),
        "bars": " ".join(
            f"M{px:.1f} {y(v.value - s):.1f}V{y(v.value + s):.1f}"
            for (px, _), v, s in zip(places, values, spread, strict=True)
        ),
        "levels": " ".join(_levels(values, at, y)),
        "limits": tuple(
            round(y(side), 1) for side in (() if limit is None else (limit, -limit)) if low <= side <= high
        ),
        "dates": tuple(_dates(values, days, x)),
        "heights": tuple(_heights(low, high, y)),
        "events": tuple(_event(event, at[event.found], one.unit, coverage_factor) for event in one.events),
        "words": f"{one.quantity} over {len(values)} sessions: {one.verdict}",
    }


def _scale(low: float, high: float, start: float, end: float) -> Callable[[float], float]:
    span = high - low

    def place(value: float) -> float:
        return (start + end) / 2.0 if span <= 0.0 else start + (value - low) / span * (end - start)

    return place


def _reach(values: Sequence[HistoryValue], k: float, limit: float | None) -> tuple[float, float]:
    low = min(value.value - k * (value.u or 0.0) for value in values)
    high = max(value.value + k * (value.u or 0.0) for value in values)
    span = (high - low) or abs(high) or 1.0
    for side in () if limit is None else (limit, -limit):
        if low - span <= side <= high + span:
            low, high = min(low, side), max(high, side)
    room = 0.06 * ((high - low) or span)
    return low - room, high + room


def _levels(
    values: Sequence[HistoryValue], at: Mapping[str, tuple[float, float]], y: Callable[[float], float]
) -> Iterable[str]:
    stretch: list[tuple[float, float]] = []
    for session, level in (*((value.session, value.level) for value in values), ("", None)):
        if stretch and (level is None or level != stretch[0][1]):
            yield f"M{stretch[0][0] - 3:.1f} {y(stretch[0][1]):.1f}H{stretch[-1][0] + 3:.1f}"
            stretch = []
        if level is not None:
            stretch.append((at[session][0], level))


def _dates(values: Sequence[HistoryValue], days: Sequence[float], x: Callable[[float], float]) -> Iterable[TrendMark]:
    begins = values[0].started or ""
    first, last = begins[:10], (values[-1].started or "")[:10]
    if days[-1] - days[0] < _FEW_DAYS:
        yield TrendMark(round(x(days[0]), 1), first)
        if last != first:
            yield TrendMark(round(x(days[-1]), 1), last)
        return
    zone = datetime.fromisoformat(begins).tzinfo
    years = range(int(first[:4]) + 1, int(last[:4]) + 1)
    for year in years[:: 1 + len(years) // _MOST_YEARS]:
        yield TrendMark(round(x(datetime(year, 1, 1, tzinfo=zone).timestamp() / _DAY_S), 1), str(year))


def _heights(low: float, high: float, y: Callable[[float], float]) -> Iterable[TrendMark]:
    span = high - low
    step = step_of(span / _DIVISIONS) if span > 0.01 else span / 2.0 or 1.0  # noqa: PLR2004 - what `step_of` tells apart
    tick = -(-low // step) * step
    while tick <= high:
        yield TrendMark(round(y(tick), 1), f"{tick + 0.0:.4g}" if abs(tick) > step / 2.0 else "0")
        tick += step


def _event(event: TrendEvent[str], at: tuple[float, float], unit: str, coverage_factor: float) -> TrendMark:
    difference = difference_in_words(event.difference, event.u_difference, unit, coverage_factor)
    words = f"{event.verdict} since {event.since}, seen in {event.found}: {difference}"
    return TrendMark(round(at[0], 1), words, event.verdict.split()[0], round(at[1], 1))
