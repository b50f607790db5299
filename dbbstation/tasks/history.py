"""Histories of the machines in a folder of sessions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from dbbstation.tasks import options as o
from dbbstation.tasks.declare import File, Option, paths_of, task
from dbbstation.tasks.telling import Telling

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Unpack

    from dbbstation.plan.tolerance import Tolerance
    from dbbstation.results.history import HistoryResult
    from dbbstation.tasks.telling import Hooks


@task("history", label="sessions")
def history(
    folder: Annotated[
        File, Option("with sessions, and models of `calibrate` or `diagnose`.", kind="argument", metavar="FOLDER")
    ],
    *,
    false_alarms: Annotated[
        float,
        Option(o.FALSE_ALARMS, least=1e-6, most=0.1),
    ] = 1e-3,
    tests: o.Tests = (),
    exclude: o.Exclude = (),
    source_files: o.SourceFiles = (),
    anew: o.Anew = False,
    tolerances: Sequence[Tolerance] = (),
    coverage_factor: float = 2.0,
    **hooks: Unpack[Hooks],
) -> HistoryResult:
    r"""Show the figures of a folder of sessions over time, machine by machine, and changes beyond uncertainty.

    The figures are G, centre X and Y, mean radial error R and centre distance C of every test and direction. Models in
    the folder add their parameters, if they were fitted to its sessions. Limits come from the shop's settings. A
    two-sided CUSUM watches each quantity from its second session on, with a further limit for single sessions.
    --false-alarms is the probability per session, over all quantities of a machine together. No model is fitted. An
    index in the user's cache folder keeps the results.

    \b
    Examples:
      dbbstation history sessions
      dbbstation history sessions --page history.html --table history.csv
      dbbstation history sessions --tests a,g --false-alarms 0.0001 --json

    Args:
        tolerances: limits of circles.
        coverage_factor: k of the expanded uncertainty.
        stop: asked after each session.

    Raises:
        ArgumentError: a value that it does not take.
        InputError: no usable session; an unknown test.
        StoppedError: `stop` returned True; what was read is indexed.
    """
    from pathlib import Path

    from dbbstation.history.trend import TrendOptions
    from dbbstation.tasks.histories import histories_in

    asked = TrendOptions(coverage_factor, tolerances, false_alarms, tuple(tests), tuple(exclude))
    telling = Telling(**hooks)
    found = histories_in(
        Path(folder), asked, paths_of(source_files), rebuild=anew, counted=telling.counted("reading sessions")
    )
    telling.note(*found.remarks)
    return found
