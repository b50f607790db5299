"""Report measured circles and the shop's tolerances in one HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from dbbstation.errors import StationError
from dbbstation.files.inputs import in_a_book
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import File, Option, paths_of, task
from dbbstation.tasks.telling import Telling

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Unpack

    from dbbstation.files.formats.settings import Settings
    from dbbstation.files.provenance import Provenance
    from dbbstation.results.report import ReportResult
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.telling import Hooks

STAGES = {
    "circles": 0,
    "circles before": 40,
    "reading runs": 60,
    "predicting runs": 75,
    "effects of causes": 82,
    "writing": 90,
    "printing": 95,
}
"""Stages of a report, and the share of its time that has passed at each begin [%]."""

USUAL_COVERAGE = 2.0


@task("report", stages=STAGES)
@in_a_book
def report(
    sessions: o.SessionPaths,
    page: Annotated[File, Option(o.OUTPUTS["page"], kind="file")],
    *,
    settings: Settings,
    before: Annotated[File | None, Option("Earlier session for comparison.")] = None,
    model: o.Model | None = None,
    job: Annotated[str, Option("Job or order number of the measurement.")] = "",
    place: Annotated[
        str, Option("Place of the measurement, which a certificate needs  [with --certificate a terminal asks for it].")
    ] = "",
    certificate: Annotated[
        bool, Option("Refuse to write the report if it lacks a fact that a certificate needs.")
    ] = False,
    source_files: o.SourceFiles = (),
    tests: o.Tests = (),
    exclude: o.Exclude = (),
    pdf: Annotated[
        File | None, Option("Write the report here too, as PDF by an installed Chromium.", kind="file")
    ] = None,
    force: o.Force = False,
    coverage_factor: float = USUAL_COVERAGE,
    known: Mapping[str, ErrorSource] | None = None,
    provenance: Callable[[], Provenance] | None = None,
    **hooks: Unpack[Hooks],
) -> ReportResult:
    r"""Write a report of measured circles: one HTML file that opens anywhere, without network, and prints to A4.

    Its first page compares the circles with the tolerances of the shop's settings and states what to do. Conditions,
    polar traces, figures with U and findings of every run follow. With --model, the model's residual and unidentifiable
    directions follow. All files with their SHA-256 are last. With --before both sessions are shown side by side as
    measured. The figures are the same as in `circles` and `evaluate`.

    \b
    Examples:
      dbbstation report session --page report.html
      dbbstation report verified --before measured --model joint.yaml --page report.html
      dbbstation report session --certificate --place "hall 3" --page report.html --pdf report.pdf
      dbbstation report session --job "spindle exchanged" --page report.html --pdf report.pdf

    Args:
        settings: with tolerances.
        known: error sources by name; None: those of package, installed packages and `source_files`.

    Raises:
        ArgumentError: a value that it does not take.
        InputError: faults of files.
        OutputError: a file exists without `force`; no browser prints.
        ModelError: the model is of another machine.
        StationError: `certificate` is set and something is missing; nothing was written.
        StoppedError: `stop` returned True; nothing was written.
    """
    from dataclasses import replace

    from dbbstation.circles.path import TOLERATED
    from dbbstation.files.atomic import refuse_outputs, write_bytes
    from dbbstation.files.provenance import from_python
    from dbbstation.files.recordings.session import read_session
    from dbbstation.machine.geometry import check_model_is_of
    from dbbstation.report.content import Reported, certified_of, content_of, numbers_of
    from dbbstation.report.html import chromium, printed, report_html
    from dbbstation.results.circles import NO_CIRCLES
    from dbbstation.tasks.circle_runs import load_circles
    from dbbstation.tasks.models import model_of, sources_known
    from dbbstation.tasks.reporting import logo_of, modelled_runs, ranked_causes, read_runs

    out, paper = Path(page), None if pdf is None else Path(pdf)
    refuse_outputs([out, paper], force=force)
    browser = None if paper is None else chromium()
    logo = logo_of(settings)
    telling = Telling(**hooks)
    identified = None if model is None else model_of(model, sources_known(known, source_files))
    # Circles, evaluation and ranking need the same recordings: each is read once.
    now = [read_session(path, keeps=identified is not None) for path in paths_of(sessions)]
    then = None if before is None else read_session(Path(before), keeps=identified is not None)
    found = load_circles(
        now, TOLERATED, tests, exclude, findings=True, model=identified, progress=telling.counted("circles")
    )
    former = NO_CIRCLES if then is None else load_circles([then], TOLERATED, progress=telling.counted("circles before"))
    modelled = ranked = None
    if identified is not None:
        for session in found.sessions:
            check_model_is_of(session.machine, identified.model.machine)
        runs = read_runs(now, (tests, exclude), telling)
        modelled = modelled_runs(runs, identified, telling)
        nominal = now if then is None else [then]
        ranked = ranked_causes(nominal, runs if then is None else None, (tests, exclude), identified, telling)
    reported = Reported(found, TOLERATED, settings, coverage_factor, former, modelled, job, ranked, place, logo)
    lacking = certified_of(reported).lacking
    if certificate and lacking:
        what = f"this is no certificate: {', '.join(lacking)}"
        remedy = (
            "note them when it is measured (`measure --help` has the options), give --place and --job, write tolerances into the settings; or "
            "leave --certificate out"
        )
        raise StationError(what, where=", ".join(session.name for session in found.sessions), remedy=remedy)
    numbers = numbers_of(reported, str(out))
    telling.stage("writing")
    html = report_html(numbers, content_of(reported, numbers, (provenance or from_python)()))
    write_bytes(out, html, force=force)
    if paper is not None and browser is not None:
        telling.stage("printing")
        write_bytes(paper, printed(html, browser), force=force)
    return replace(numbers, pdf=paper)
