"""`dbbstation report`: a session as one HTML file that anyone can read and print."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dbbstation.cli.chosen_tests import chosen_tests_options
from dbbstation.cli.output import echo
from dbbstation.cli.source_files import source_file_option

if TYPE_CHECKING:
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.report.content import Modelled
    from dbbstation.results.circles import Circled


@click.command()
@click.argument("sessions", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="SESSION...")
@click.option("--before", type=click.Path(path_type=Path), help="Session that was measured before, to put beside.")
@click.option(
    "--model", type=click.Path(path_type=Path), help="Model file of `calibrate` or `diagnose`, to put beside."
)
@click.option(
    "--job", default="", help="What was measured for, where the session does not say it or says something else."
)
@source_file_option
@chosen_tests_options
@click.option(
    "--out", required=True, type=click.Path(path_type=Path, dir_okay=False), help="Write the report here, as HTML."
)
@click.option(
    "--pdf", type=click.Path(path_type=Path, dir_okay=False), help="Print it here too, by an installed Chromium."
)
@click.option("--force", is_flag=True, help="Replace existing files.")
@click.option("--json", "as_json", is_flag=True, help="Print the numbers of the report as JSON.")
def report(
    sessions: tuple[Path, ...],
    *,
    before: Path | None,
    model: Path | None,
    job: str,
    source_files: tuple[Path, ...],
    tests: tuple[str, ...],
    exclude: tuple[str, ...],
    out: Path,
    pdf: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    r"""Write a report of measured circles: one HTML file that opens anywhere, without network, and prints to A4.

    Its first page holds the circles against the tolerances of the shop's settings and says what to do. Then come
    conditions, polar traces, figures with U, findings of every run, with --model what it leaves and could not see, and all
    files with their SHA-256. With --before both sessions stand side by side as measured. The figures are those of
    `circles` and `evaluate`.

    \b
    Examples:
      dbbstation report session --out report.html
      dbbstation report verified --before measured --model joint.yaml --out report.html
      dbbstation report session --job "spindle exchanged" --out report.html --pdf report.pdf
    """
    from dbbstation.cli.output import COVERAGE_FACTOR, print_json, say
    from dbbstation.cli.provenance import provenance
    from dbbstation.cli.shop import shop_settings
    from dbbstation.files.atomic import refuse_outputs, write_bytes
    from dbbstation.files.formats.model import read_model
    from dbbstation.files.own_sources import every_source
    from dbbstation.report.content import Reported, content_of, numbers_of
    from dbbstation.report.html import report_html
    from dbbstation.report.pdf import chromium, printed
    from dbbstation.results.tolerances import TOLERATED

    refuse_outputs([out, pdf], force=force)
    browser = None if pdf is None else chromium()
    settings = shop_settings()
    identified = None if model is None else read_model(model, every_source(source_files))
    found, former, modelled = _read(sessions, before, identified, tests, exclude)
    reported = Reported(found, TOLERATED, settings, COVERAGE_FACTOR, former, modelled, job)
    numbers = numbers_of(reported)
    html = report_html(content_of(reported, numbers, provenance()))
    write_bytes(out, html, force=force)
    say(f"report written to {out}")
    if pdf is not None and browser is not None:
        write_bytes(pdf, printed(html, browser), force=force)
        say(f"printed to {pdf}")
    if as_json:
        print_json({"report": str(out), **numbers})
    else:
        _print(numbers["verdict"])


def _read(
    sessions: tuple[Path, ...],
    before: Path | None,
    identified: IdentifiedModel | None,
    tests: tuple[str, ...],
    exclude: tuple[str, ...],
) -> tuple[Circled, Circled | None, Modelled | None]:
    """Read what a report needs: circles, circles before, and what the model leaves."""
    from dbbstation.cli.progress import count_bar
    from dbbstation.machine.difference import check_model_is_of
    from dbbstation.results.tolerances import TOLERATED
    from dbbstation.tasks.circles import load_circles

    with count_bar("circles") as progress:
        found = load_circles(sessions, TOLERATED, tests, exclude, findings=True, model=identified, progress=progress)
    former = None
    if before is not None:
        with count_bar("circles before") as progress:
            former = load_circles([before], TOLERATED, progress=progress)
    if identified is None:
        return found, former, None
    for session in found.sessions:
        check_model_is_of(session.machine, identified.model.machine)
    return found, former, _modelled(sessions, identified, tests, exclude)


def _modelled(
    sessions: tuple[Path, ...], identified: IdentifiedModel, tests: tuple[str, ...], exclude: tuple[str, ...]
) -> Modelled:
    """Return what a model leaves; a run that it cannot take leaves the report without that, and says so."""
    from dbbstation.cli.progress import stage_bar
    from dbbstation.errors import StationError
    from dbbstation.report.content import Modelled
    from dbbstation.results.serialise import plain
    from dbbstation.tasks.evaluate import STAGES, evaluate

    try:
        with stage_bar("evaluation", STAGES) as progress:
            found = evaluate(sessions, identified, tests=tests, exclude=exclude, progress=progress)
        return Modelled(identified, {key: value for key, value in plain(found).items() if key != "tolerances"})
    except StationError as error:
        return Modelled(identified, {}, str(error))


def _print(verdict: dict[str, Any]) -> None:
    echo(verdict["headline"])
    for text in (*verdict["reasons"], *verdict["to_do"]):
        echo(f"- {text}")
