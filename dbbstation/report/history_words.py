"""Words of a history for terminal and page."""

from __future__ import annotations

from collections import Counter
from math import floor, log10
from typing import TYPE_CHECKING

from dbbstation.text.written import listed

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dbbstation.results.history import MachineHistoryResult, QuantityHistory

MOST_NAMED = 5
"""Greatest number of quantities that are named for one change; the table has all."""

_COARSE = 0.1
"""Least U for which one decimal is enough: a tenth of a micrometre, as in every other table."""

DASH = "–"
"""Text for a missing number."""


def rounded(value: float | None, u: float | None, coverage_factor: float) -> str:
    """Return a number with decimals by its uncertainty."""
    if value is None:
        return DASH
    if not u:
        return f"{value:.4g}"
    expanded = coverage_factor * u
    decimals = 1 if expanded >= _COARSE else 1 - floor(log10(expanded))
    return f"{round(value, decimals) + 0.0:.{decimals}f}"


def verdict_in_words(one: QuantityHistory) -> str:
    """Return a quantity's verdict in words, or the reason for its absence."""
    if one.why_not:
        return one.why_not if one.limit is not None or one.figure == "C" else f"{one.verdict}: {one.why_not}"
    lacking = one.sessions_lacking
    if not one.watched_sessions:
        more = (lacking or 0) + 1
        return f"{one.verdict}: needs {more} more session{'s' if more > 1 else ''}"
    by = ", by stated U" if one.decided_by == "stated-uncertainty" else ""
    return one.verdict + by + (f", watched again after {lacking} more" if lacking else "")


def headline(machine: MachineHistoryResult) -> str:
    """Return the number of a machine's changes."""
    if not machine.changes:
        if any(one.watched_sessions for one in machine.quantities):
            return "Nothing changed beyond scatter and uncertainty"
        return "Cannot tell whether anything changed: there is one session of each quantity"
    counts = Counter(change.verdict for change in machine.changes)
    changed, single = counts["changed"], counts["stands out"]
    counted = [f"{changed} change{'s' if changed > 1 else ''}"] if changed else []
    counted += [f"{single} session{'s stand' if single > 1 else ' stands'} out"] if single else []
    return ", ".join(counted)


def changes_in_words(machine: MachineHistoryResult, coverage_factor: float) -> Iterator[str]:
    """Yield a line per session with changes, largest quantities first."""
    for change in machine.changes:
        found, since = change.found, change.since
        when = f"{found.name} ({found.date})"
        where = "" if since.name == found.name else f", since {since.name} ({since.date})"
        beside = f"; {', '.join(change.beside)}" if change.beside else ""
        sizes = [
            f"{one.quantity} {difference_in_words(one.difference, one.u_difference, one.unit, coverage_factor)}"
            for one in change.quantities
        ]
        yield f"{change.verdict}: {when}{where}{beside}: {listed(sizes, MOST_NAMED)}"


def difference_in_words(difference: float, u: float, unit: str, coverage_factor: float) -> str:
    """Return a difference with its sign, U and unit."""
    value = rounded(difference, u, coverage_factor)
    sign = "" if value.startswith("-") else "+"
    return f"{sign}{value} {unit} (U {rounded(coverage_factor * u, u, coverage_factor)})"
