"""Check the dates of sessions."""

from __future__ import annotations

from bisect import bisect_left
from itertools import pairwise
from typing import TYPE_CHECKING

from dbbstation.text.written import natural

if TYPE_CHECKING:
    from collections.abc import Sequence
    from datetime import datetime

    from dbbstation.history.record import SessionFigures

MOSTLY = 0.8
"""Share of a machine's sessions whose names must be in date order before a name counts as evidence of the order. Random
names agree on about 2 / sqrt(n) of n [Logan and Shepp 1977]: a third of 36."""


def date_faults(sessions: Sequence[SessionFigures], now: datetime) -> list[str]:
    """Return messages on repeated, future or out-of-order dates."""
    faults = []
    by_date = sorted(sessions, key=_dated)
    for one, other in pairwise(by_date):
        if one.started == other.started:
            faults.append(
                f"{one.name} and {other.name} both start at {moment_words(other.started)}; they are taken by their names"
            )
    faults += [
        f"{one.name} is dated {moment_words(one.started)}, which is still to come: was the clock set wrong?"
        for one in by_date
        if one.started is not None and one.started > now
    ]
    by_name = sorted(sessions, key=lambda one: natural(one.name))
    outside = _out_of_order([_dated(one) for one in by_name])
    if 0 < len(outside) <= (1.0 - MOSTLY) * len(by_name):
        for k in outside:
            other = by_name[k - 1] if k else by_name[1]
            where = "follows" if k else "precedes"
            faults.append(
                f"{by_name[k].name} is dated {moment_words(by_name[k].started)} and {where} {other.name}, dated "
                f"{moment_words(other.started)}, by its name: was the clock set wrong?"
            )
    return faults


def moment_words(moment: datetime | None) -> str:
    """Return a moment in words."""
    return "–" if moment is None else f"{moment:%Y-%m-%d %H:%M}"


def by_time(session: SessionFigures) -> tuple[float, tuple[tuple[int, int, str], ...]]:
    """Return a sort key by date, then name."""
    return _dated(session), natural(session.name)


def _dated(session: SessionFigures) -> float:
    return -1.0 if session.started is None else session.started.timestamp()


def _out_of_order(values: Sequence[float]) -> list[int]:
    tails: list[float] = []
    ends: list[int] = []
    before: list[int | None] = []
    for k, value in enumerate(values):
        place = bisect_left(tails, value + 1e-9)
        before.append(ends[place - 1] if place else None)
        tails[place : place + 1] = [value]
        ends[place : place + 1] = [k]
    kept = set[int]()
    last = ends[-1] if ends else None
    while last is not None:
        kept.add(last)
        last = before[last]
    return [k for k in range(len(values)) if k not in kept]
