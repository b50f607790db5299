"""Compare two sessions: where they differ and by which cause."""

from __future__ import annotations

import os
from functools import partial
from typing import TYPE_CHECKING

from dbbstation.diagnosis.compare.comparison import compare as put_side_by_side
from dbbstation.diagnosis.compare.notes import notes_of
from dbbstation.diagnosis.diagnose import usable_sources
from dbbstation.errors import InputError, Problem
from dbbstation.results.of_comparison import comparison_result
from dbbstation.sources.registry import known_sources, sources_named
from dbbstation.tasks.diagnose import default_candidates
from dbbstation.tasks.load import load
from dbbstation.tasks.telling import Telling, never, silent

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from os import PathLike

    from dbbstation.diagnosis.compare.comparison import Comparison
    from dbbstation.results.comparison import ComparisonResult
    from dbbstation.tasks.telling import Progress

STAGES = {"candidates": 1, "sets of causes": 30, "look": 60, "held-out tests": 80}
"""Stages of a comparison once both sessions are read, and the share of its time that has passed by then [%]."""


def compare(
    a: str | PathLike[str],
    b: str | PathLike[str],
    *,
    tests: Sequence[str] = (),
    exclude: Sequence[str] = (),
    hold_out: bool = True,
    progress: Progress = silent,
    stop: Callable[[], bool] = never,
    say: Callable[[str], None] = silent,
) -> ComparisonResult:
    """Compare two sessions: where they differ, in what form, by which cause, as B less A.

    Args:
        a: its readings serve as the simulation of B.
        tests: names; empty for all.
        hold_out: choose anew without each group of tests, to check predictions.

    Returns:
        What was found; `drawing` draws it.

    Raises:
        InputError: faults of files; one session twice.
        TraceError: no common run; circles with removed centres.
        StoppedError: `stop` returned True.
    """
    telling = Telling(progress, stop, say)
    one, other = (load(each, tests=tests, exclude=exclude, progress=progress, stop=stop) for each in (a, b))
    if set(one.sessions.values()) == set(other.sessions.values()):
        what = f"this is the same session as {os.fspath(a)}, byte for byte"
        raise InputError([Problem(os.fspath(b), 0, 0, what, "give two sessions")])
    for name, recorded in (("A", one), ("B", other)):
        telling.note(*(f"{name}: {warning}" for warning in recorded.warnings))
    candidates = sources_named(default_candidates(known_sources()))
    usable, lacking = usable_sources(one.machine, [*one.observations, *other.observations], candidates)
    found = put_side_by_side(
        one.machine, one.observations, other.observations, usable, lacking, telling.stage, hold_out=hold_out
    )
    return comparison_result(
        found,
        notes_of(one.machine, other.machine, found.matching.pairs),
        a=os.fspath(a),
        b=os.fspath(b),
        drawing=partial(_drawn, found),
        notes=tuple(telling.notes),
    )


def _drawn(found: Comparison, wanted: object) -> bytes:
    from dbbstation.report.compare_figure import compare_figure  # noqa: PLC0415 - half a second for who draws nothing
    from dbbstation.report.figure_format import figure_format  # noqa: PLC0415

    return compare_figure(found, figure_format(wanted))
