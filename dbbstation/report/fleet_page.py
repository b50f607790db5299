"""A fleet as one HTML file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.computing.grouped import grouped
from dbbstation.facts.digits import decimals_of
from dbbstation.report.history_words import DASH
from dbbstation.report.html import environment

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.files.provenance import Provenance
    from dbbstation.results.fleet import FleetResult, FleetSession, Scored

WIDTH, HEIGHT = 220, 22
"""Size of a machine's strip of scores in drawing units."""

REACH = 6.0
"""Greatest score that a strip shows; larger scores are drawn at its end."""


def fleet_html(result: FleetResult, provenance: Provenance) -> bytes:
    """Return a fleet as HTML without script, linking only to its results."""
    machines = grouped((session.machine or session.session, session) for session in result.sessions)
    rows = [_row(name, sessions, result) for name, sessions in machines.items()]
    ticks = [(x, label) for label, x in ((f"{tick:+d}" if tick else "0", _place(tick)) for tick in (-4, -2, 0, 2, 4))]
    content = {
        "result": result,
        "comparison": result.comparison,
        "headline": headline_of(result),
        "rows": rows,
        "unlike": [] if result.comparison is None else [(one, _digits(one)) for one in result.comparison.unlike],
        "expected": _expected(result),
        "size": (WIDTH, HEIGHT),
        "ticks": ticks,
        "provenance": provenance,
    }
    return environment().get_template("fleet.html").render(content).encode()


def headline_of(result: FleetResult) -> str:
    """Return a fleet's result in a sentence."""
    failed = len(result.failed)
    done = f"{len(result.sessions) - failed} of {len(result.sessions)} sessions done"
    if failed:
        done += f", {failed} failed"
    if result.comparison is None or not result.comparison.quantities:
        return f"{done}."
    unlike = {one.machine for one in result.comparison.unlike}
    if not unlike:
        return f"{done}. No machine is unlike its sisters."
    return f"{done}. {len(unlike)} of {result.comparison.machines} machines {'is' if len(unlike) == 1 else 'are'} unlike the others."


def _digits(one: Scored) -> tuple[str, ...]:
    sure = one.uncertainty or one.scatter
    numbers = (one.value, one.uncertainty, one.usual, one.scatter, one.smallest_seen)
    form = f".{decimals_of(sure)}f" if sure else ".4g"
    return tuple(DASH if number is None else f"{number:{form}}" for number in numbers)


def _expected(result: FleetResult) -> str:
    if result.comparison is None or not result.comparison.quantities:
        return ""
    of = result.comparison
    return (
        f"{of.quantities} quantities of {of.machines} machines were compared. Where all machines are alike, any value is marked "
        f"with a probability of {of.false_alarms:g}, all quantities and machines together."
    )


def _row(name: str, sessions: Sequence[FleetSession], result: FleetResult) -> dict[str, object]:
    # The last finished session, or a failed one.
    shown = next((one for one in sessions if one.compared), sessions[-1])
    every = () if result.comparison is None else result.comparison.scored
    scored = [one for one in every if one.session == shown.session and one.score is not None]
    unlike = tuple(sorted((one for one in scored if one.unlike), key=lambda one: -abs(one.score or 0.0)))
    words = f"{len(scored)} scores of {name}"
    if scored:
        words += f" from {min(one.score or 0.0 for one in scored):.1f} to {max(one.score or 0.0 for one in scored):.1f}"
    return {
        "name": name,
        "session": shown,
        "others": len(sessions) - 1,
        "unlike": unlike,
        "marks": _strokes([one.score or 0.0 for one in scored if not one.unlike]),
        "marked": _strokes([one.score or 0.0 for one in scored if one.unlike]),
        "words": words,
    }


def _strokes(scores: Sequence[float]) -> str:
    return " ".join(f"M{_place(score):.1f} 5v12" for score in scores)


def _place(score: float) -> float:
    return round(WIDTH / 2.0 + max(-REACH, min(REACH, score)) / REACH * (WIDTH / 2.0 - 6.0), 1)
