"""From session folders to the figures of their circles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option, task
from dbbstation.tasks.telling import Telling, never, silent

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.results.circles import CirclesResult
    from dbbstation.tasks.telling import Progress


@task("circles")
def circles(
    sessions: o.SessionPaths,
    *,
    filter: o.Filter = "none",  # noqa: A002 - the standard's word
    findings: Annotated[bool, Option("Judge every run too: number, limit, verdict.")] = False,
    model: Annotated[
        o.Model | None, o.model("Expect circles where this model has them; with --findings.", only_with="findings")
    ] = None,
    quick_look: Annotated[
        bool, Option("Look for the classical signatures of serial axes: symptoms, no causes here.")
    ] = False,
    tests: o.Tests = (),
    exclude: o.Exclude = (),
    progress: Progress = silent,
    stop: Callable[[], bool] = never,
    say: Callable[[str], None] = silent,
) -> CirclesResult:
    r"""Work out the figures of measured circles, in the words of ISO 230-4:2005; no model is needed.

    G is the circular deviation of the minimum zone, G(LS) about the least-squares circle, which is permitted too. F is the
    radial deviation about the least-squares centre. X and Y are the centre less the commanded one: reported, never taken
    out of calibration data. G(b), D and H are of both directions together. U is 2 u; --budget shows its terms.

    \b
    Examples:
      dbbstation circles session
      dbbstation circles session --filter 50 --csv circles.csv
      dbbstation circles session --findings --model model.yaml
      dbbstation circles session --test a --budget --json
      dbbstation circles session --test a --quick-look

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
    from dbbstation.tasks.load import paths_of
    from dbbstation.tasks.models import model_of

    telling = Telling(progress, stop, say)
    chosen = Filter(0 if filter == "none" else int(filter))
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
    return circles_result(found, chosen, quick_look=quick_look)
