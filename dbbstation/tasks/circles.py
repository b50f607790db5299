"""Compute the figures of the circles of sessions."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Literal

from dbbstation.errors import ArgumentError
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option, drawing, paths_of, task
from dbbstation.tasks.telling import Telling

if TYPE_CHECKING:
    from typing import Unpack

    from numpy.typing import ArrayLike

    from dbbstation.results.circles import CircleFiguresResult, CirclesResult
    from dbbstation.tasks.telling import Hooks


@task("circles")
def circles(
    sessions: o.SessionPaths,
    *,
    filter: o.Filter = "none",  # noqa: A002 - the standard's word
    findings: o.Findings = False,
    model: Annotated[o.Model | None, o.MODEL_WITH_FINDINGS] = None,
    quick_look: Annotated[
        bool, Option("Fit the classical signatures of serial axes, which are only symptoms on a hexapod.")
    ] = False,
    kind: Annotated[Literal["polar", "deviation", "spectrum", "map", "compare"], Option("Kind of figure.")] = "polar",
    tests: o.Tests = (),
    exclude: o.Exclude = (),
    **hooks: Unpack[Hooks],
) -> CirclesResult:
    r"""Compute the figures of measured circles, in the terms of ISO 230-4:2005. No model is needed.

    G is the circular deviation of the minimum zone; G(LS) is the circular deviation about the least-squares circle. The
    standard permits both. F is the radial deviation about the least-squares centre. X and Y are the measured centre
    minus the commanded centre; calibration keeps them. G(b), D and H combine both directions. U is 2 u; --budget shows
    its terms.

    --figure draws both directions of a test in one picture, repeats as thin lines, with a title block:

    \b
    polar      deviation from the least-squares circle, rings one division apart
    deviation  the same over the angle
    spectrum   amplitude by undulations per revolution, beside the amplitude of noise alone
    map        centres of the circles at the positions of their balls
    compare    the same tests in two sessions or more, to one scale

    \b
    Examples:
      dbbstation circles session
      dbbstation circles session --filter 50 --table circles.csv
      dbbstation circles session --findings --model model.yaml
      dbbstation circles session --tests a --budget --json
      dbbstation circles session --tests a --quick-look
      dbbstation circles session --tests a,g --kind deviation --figure a-g.pdf
      dbbstation circles before after --tests a --kind compare --figure a.png

    Args:
        stop: asked after each run.

    Raises:
        ArgumentError: a value that it does not take.
        InputError: every fault of every file; no accepted run; an unknown test.
        StoppedError: `stop` returned True.
    """
    from dbbstation.circles.path import Filter
    from dbbstation.results.circles import circles_result
    from dbbstation.tasks.circle_runs import load_circles
    from dbbstation.tasks.models import model_of

    telling = Telling(**hooks)
    if kind == "compare" and len(paths_of(sessions)) == 1:
        raise ArgumentError("kind", "one session is nothing to compare: name two sessions or more")
    chosen = Filter.of_word(filter)
    found = load_circles(
        paths_of(sessions),
        chosen,
        tests,
        exclude,
        findings=findings,
        model=None if model is None else model_of(model),
        progress=telling.counted("circles"),
    )
    telling.note(*found.warnings)
    return replace(
        circles_result(found, chosen, quick_look=quick_look), drawing=drawing("circles_figure", kind, found, chosen)
    )


@task("circle")
def circle(
    t_s: ArrayLike,
    length_mm: ArrayLike,
    *,
    bar_mm: Annotated[float, Option("Nominal distance of the ball centres [mm].", above=0.0)],
    feed_mm_min: Annotated[float, Option("Feed along the circle [mm/min].", above=0.0)] = 1000.0,
    start_deg: Annotated[float, Option("Start of the full turn, from +X towards +Y [deg].")] = 0.0,
    overshoot_deg: Annotated[float, Option("Overshoot before and after the full turn [deg].", least=0.0)] = 0.0,
    feed_in_mm: Annotated[float, Option("Begin outside the circle, along the bar [mm].", above=0.0)],
    direction: Annotated[Literal["ccw", "cw"], Option("Sense of travel seen from +Z.")] = "ccw",
    filter: o.Filter = "none",  # noqa: A002 - the standard's word
) -> CircleFiguresResult:
    """Compute the figures of one circle after ISO 230-4 from arrays.

    Args:
        t_s: times, strictly rising, shape (n,) [s].
        length_mm: readings of the bar from feed-in to feed-out, shape (n,) [mm].

    Raises:
        ArgumentError: a value that it does not take.
        TraceError: the readings show no such circle.
    """
    from pathlib import Path

    import numpy as np

    from dbbstation.circles.analysis import analyse
    from dbbstation.circles.budget import SetUpKnowledge
    from dbbstation.circles.path import Filter
    from dbbstation.files.formats.session import RunEntry, RunState
    from dbbstation.plan.plan import Circle, Direction
    from dbbstation.results.circles import MeasuredCircle, circle_figures
    from dbbstation.trace.cut import cut
    from dbbstation.trace.recording import Recording

    times, lengths = np.asarray(t_s, dtype=np.float64), np.asarray(length_mm, dtype=np.float64)
    if times.ndim != 1 or times.shape != lengths.shape:
        raise ArgumentError(
            "length_mm", f"times and lengths need one shape (n,), not {times.shape} and {lengths.shape}"
        )
    middle = (0.0, 0.0, 0.0)
    planned = Circle(
        middle, middle, bar_mm, middle, feed_mm_min, start_deg, overshoot_deg, feed_in_mm, 0.0, Direction(direction)
    )
    recording = Recording("circle", times, lengths)
    entry = RunEntry(test="circle", direction=planned.direction, repeat=1, state=RunState.ACCEPTED, path=Path())
    analysis = analyse(cut(recording, planned), recording, Filter.of_word(filter))
    return circle_figures(MeasuredCircle("", entry, analysis, "", SetUpKnowledge(), None), analysis)
