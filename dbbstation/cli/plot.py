"""`dbbstation plot`: one figure of measured circles, with a title block."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from dbbstation.cli.declared import made
from dbbstation.cli.figure_option import format_of, known_format
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option


@made()
def plot(
    sessions: Annotated[tuple[Path, ...], o.SESSIONS],
    *,
    kind: Annotated[Literal["polar", "deviation", "spectrum", "map", "compare"], Option("Kind of figure.")] = "polar",
    filter: o.Filter = "none",  # noqa: A002 - the standard's word
    tests: o.Tests = (),
    exclude: o.Exclude = (),
    out: Annotated[Path, Option(o.FIGURE, kind="file", parse=known_format)],
    force: o.Force = False,
    as_json: o.Json = False,
) -> None:
    r"""Draw measured circles: one figure with a title block, as SVG, PNG or PDF.

    Both directions of a test share a picture, repeats as thin lines. The title block has machine, plan, dates of the
    runs, bar, operator, filter and program.

    \b
    polar      deviation from the least-squares circle, rings one division apart
    deviation  the same over the angle
    spectrum   amplitude by undulations per revolution, beside the amplitude of noise alone
    map        centres of the circles at the positions of their balls
    compare    the same tests in two sessions or more, to one scale

    \b
    Examples:
      dbbstation plot session --tests a --out a.svg
      dbbstation plot session --tests a,g --kind deviation --out ab.pdf
      dbbstation plot before after --tests a --kind compare --out a.png
    """
    from dbbstation.circles.path import Filter
    from dbbstation.cli.output import print_result, say
    from dbbstation.cli.progress import count_bar
    from dbbstation.files.atomic import refuse_outputs, write_bytes
    from dbbstation.report.plot import PlotKind, Plotted, plot_figure
    from dbbstation.tasks.circle_runs import load_circles

    refuse_outputs([out], force=force)
    chosen = Filter.of_word(filter)
    with count_bar("circles") as progress:
        found = load_circles(sessions, chosen, tests, exclude, progress=progress)
    for warning in found.warnings:
        say(f"note: {warning}")
    wanted = format_of(out)
    plotted = Plotted(PlotKind(kind), found, chosen, wanted.provenance.program)
    result = plotted.result(str(out))
    write_bytes(out, plot_figure(plotted, wanted), force=force)
    for one in result.one_direction_only:
        say(f"note: {one} was measured in one direction only")
    if as_json:
        print_result(result)
    else:
        say(f"figure written to {out}")
