"""`dbbstation plot`: one figure of measured circles, with a title block."""

from __future__ import annotations

from pathlib import Path

import click

from dbbstation.cli.figure_option import figure_option, format_of
from dbbstation.cli.shared_options import chosen_tests_options, filter_option

KINDS = ("polar", "deviation", "spectrum", "map", "compare")


@click.command()
@click.argument("sessions", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="SESSION...")
@click.option("--kind", type=click.Choice(KINDS), default="polar", show_default=True, help="Kind of figure.")
@filter_option
@chosen_tests_options
@figure_option("Write the figure here", "--out", required=True)
@click.option("--force", is_flag=True, help="Replace an existing file.")
@click.option("--json", "as_json", is_flag=True, help="Print what is drawn, with its figures, as JSON.")
def plot(
    sessions: tuple[Path, ...],
    *,
    kind: str,
    filter: str,  # noqa: A002 - the standard's word
    tests: tuple[str, ...],
    exclude: tuple[str, ...],
    out: Path,
    force: bool,
    as_json: bool,
) -> None:
    r"""Draw measured circles: one figure with a title block, as SVG, PNG or PDF.

    Both directions of a test share a picture, repeats as thin lines. The title block has machine, plan, dates of the
    runs, bar, operator, filter and program.

    \b
    polar      deviation from the least-squares circle, rings one division apart
    deviation  the same over the angle
    spectrum   amplitude by undulations per revolution, beside what noise alone would show
    map        centres of the circles where their balls stand
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
