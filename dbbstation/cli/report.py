"""`dbbstation report`: a session as one HTML file that anyone can read and print."""

from __future__ import annotations

from pathlib import Path

import click

from dbbstation.cli.output import echo, echo_line
from dbbstation.cli.shared_options import chosen_tests_options, source_file_option


@click.command()
@click.argument("sessions", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="SESSION...")
@click.option("--before", type=click.Path(path_type=Path), help="Session that was measured before, to put beside.")
@click.option(
    "--model", type=click.Path(path_type=Path), help="Model file of `calibrate` or `diagnose`, to put beside."
)
@click.option("--job", default="", help="Job or reason of the measurement, in place of the session's.")
@click.option(
    "--place",
    default="",
    help="Place of the measurement, which a certificate needs  [with --certificate a terminal asks for it].",
)
@click.option("--certificate", is_flag=True, help="Refuse to write if a certificate lacks a fact.")
@source_file_option
@chosen_tests_options
@click.option(
    "--page",
    "out",
    required=True,
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write the report here, as HTML.",
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
    place: str,
    certificate: bool,
    source_files: tuple[Path, ...],
    tests: tuple[str, ...],
    exclude: tuple[str, ...],
    out: Path,
    pdf: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    r"""Write a report of measured circles: one HTML file that opens anywhere, without network, and prints to A4.

    Its first page compares the circles with the tolerances of the shop's settings and states what to do. Then come
    conditions, polar traces, figures with U, findings of every run, with --model what it leaves and could not see, and all
    files with their SHA-256. With --before both sessions are shown side by side as measured. The figures are those of
    `circles` and `evaluate`.

    \b
    Examples:
      dbbstation report session --page report.html
      dbbstation report verified --before measured --model joint.yaml --page report.html
      dbbstation report session --certificate --place "hall 3" --page report.html --pdf report.pdf
      dbbstation report session --job "spindle exchanged" --page report.html --pdf report.pdf
    """
    from dbbstation.cli.asking import Asker
    from dbbstation.cli.output import COVERAGE_FACTOR, print_result, say
    from dbbstation.cli.progress import stage_bar
    from dbbstation.cli.provenance import provenance
    from dbbstation.cli.shop import shop_settings
    from dbbstation.files.own_sources import every_source
    from dbbstation.tasks.report import STAGES
    from dbbstation.tasks.report import report as written_report

    settings = shop_settings()
    if certificate and not place and (asker := Asker()).terminal:
        place = asker.text("where it was measured", "--place")
    with stage_bar("report", STAGES) as progress:
        written = written_report(
            sessions,
            out,
            settings=settings,
            before=before,
            model=model,
            job=job,
            place=place,
            certificate=certificate,
            pdf=pdf,
            coverage_factor=COVERAGE_FACTOR,
            tests=tests,
            exclude=exclude,
            force=force,
            known=None if model is None else every_source(source_files),
            provenance=provenance,
            progress=progress,
        )
    say(f"report written to {out}")
    if pdf is not None:
        say(f"printed to {pdf}")
    if as_json:
        print_result(written)
    else:
        verdict = written.verdict
        echo(written.certificate.title)
        echo(verdict.headline)
        for text in (*verdict.reasons, *verdict.to_do):
            echo_line(f"- {text}")
