"""Compare two sessions: where they differ and by which cause."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Annotated

from dbbstation.errors import InputError
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import File, Option, drawing, task
from dbbstation.tasks.telling import Telling

if TYPE_CHECKING:
    from typing import Unpack

    from dbbstation.results.comparison import ComparisonResult
    from dbbstation.tasks.telling import Hooks

STAGES = {"candidates": 1, "sets of causes": 30, "look": 60, "held-out tests": 80}
"""Stages of a comparison after reading, and the share of its time that has passed at each begin [%]."""


@task("compare", label="comparison", stages=STAGES)
def compare(
    a: Annotated[File, Option("session whose readings are the simulation of B.", kind="argument", metavar="A")],
    b: Annotated[File, Option("session.", kind="argument", metavar="B")],
    *,
    tests: o.Tests = (),
    exclude: o.Exclude = (),
    held_out: o.HeldOut = True,
    **hooks: Unpack[Hooks],
) -> ComparisonResult:
    r"""Compare two sessions: where they differ, in what form, and by which cause. Differences are B less A.

    Compare last year with today, or a simulation with a recording. The readings of A serve as the simulation of B.
    Stated noise, scatter of mountings, and uncertainty of CMM sheets and bars do not count as a difference. The command
    compares changed error sources, displaced balls and bars, and unnamed effects by probability, as `diagnose` does.

    \b
    Examples:
      dbbstation compare 2025-11-18-hexapod-7 2026-11-20-hexapod-7
      dbbstation compare predicted 2026-11-20-hexapod-7 --figure difference.svg
      dbbstation compare predicted 2026-11-20-hexapod-7 --json

    Returns:
        What was found; `drawing` draws it.

    Raises:
        ArgumentError: a value that it does not take.
        InputError: faults of files; one session twice.
        TraceError: no common run; circles with removed centres.
        StoppedError: `stop` returned True.
    """
    from dbbstation.diagnosis.compare.comparison import compare as put_side_by_side
    from dbbstation.diagnosis.compare.comparison import notes_of
    from dbbstation.diagnosis.diagnose import usable_sources
    from dbbstation.results.comparison import comparison_result
    from dbbstation.sources.registry import known_sources, sources_named
    from dbbstation.tasks.diagnosed import default_candidates
    from dbbstation.tasks.load import loaded

    telling = Telling(**hooks)
    one, other = (loaded(each, tests, exclude, Telling(telling.stage)) for each in (a, b))
    if set(one.sessions.values()) == set(other.sessions.values()):
        what = f"this is the same session as {os.fspath(a)}, byte for byte"
        raise InputError.of(os.fspath(b), what, "give two sessions")
    for name, recorded in (("A", one), ("B", other)):
        telling.note(*(f"{name}: {warning}" for warning in recorded.warnings))
    candidates = sources_named(default_candidates(known_sources()))
    usable, lacking = usable_sources(one.machine, [*one.observations, *other.observations], candidates)
    found = put_side_by_side(
        one.machine, one.observations, other.observations, usable, lacking, telling.stage, hold_out=held_out
    )
    return comparison_result(
        found,
        notes_of(one.machine, other.machine, found.matching.pairs),
        a=os.fspath(a),
        b=os.fspath(b),
        drawing=drawing("compare_figure", found),
        notes=tuple(telling.notes),
    )
