"""Report: measured circles against the shop's tolerances, as one HTML file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dbbstation.errors import StationError
from dbbstation.files.atomic import refuse_outputs, write_bytes
from dbbstation.machine.difference import check_model_is_of
from dbbstation.report.content import Modelled, Reported, content_of, numbers_of
from dbbstation.report.html import report_html
from dbbstation.report.pdf import chromium, printed
from dbbstation.results.serialise import plain
from dbbstation.results.tolerances import TOLERATED
from dbbstation.tasks.circles import load_circles
from dbbstation.tasks.evaluate import evaluate
from dbbstation.tasks.load import paths_of
from dbbstation.tasks.models import model_of
from dbbstation.tasks.provenance import from_python
from dbbstation.tasks.telling import StoppedError, Telling, never, silent

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from os import PathLike

    from dbbstation.files.formats.settings import Settings
    from dbbstation.files.provenance import Provenance
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.load import Sessions
    from dbbstation.tasks.models import Model
    from dbbstation.tasks.telling import Progress

STAGES = {"circles": 0, "circles before": 40, "reading runs": 60, "predicting runs": 75, "writing": 90, "printing": 95}
"""Stages of a report, and the share of its time that has passed by then [%]."""

USUAL_COVERAGE = 2.0


@dataclass(frozen=True, eq=False)
class WrittenReport:
    """A report that was written.

    Attributes:
        file: the page.
        pdf: the same on paper; None where it was not printed.
        numbers: everything that it shows, as `report --json` prints it.
    """

    file: Path
    pdf: Path | None
    numbers: Mapping[str, Any]


def report(
    sessions: Sessions,
    out: str | PathLike[str],
    *,
    settings: Settings,
    before: str | PathLike[str] | None = None,
    model: Model | None = None,
    job: str = "",
    pdf: str | PathLike[str] | None = None,
    coverage_factor: float = USUAL_COVERAGE,
    tests: Sequence[str] = (),
    exclude: Sequence[str] = (),
    force: bool = False,
    known: Mapping[str, ErrorSource] | None = None,
    provenance: Callable[[], Provenance] = from_python,
    progress: Progress = silent,
    stop: Callable[[], bool] = never,
) -> WrittenReport:
    """Write a report of measured circles: one HTML file that opens anywhere, without network, and prints to A4.

    Args:
        sessions: session folders or session files.
        out: HTML file to write.
        settings: of the shop, with its tolerances.
        before: session that was measured before, to put beside.
        model: a model, a file of one, or the result of `calibrate` or `diagnose`, to put beside.
        job: what was measured for, where the session does not say it or says something else.
        pdf: file to print to, by an installed Chromium; None: none.
        coverage_factor: k of U = k u.
        tests: names of tests to take; empty for all.
        exclude: names of tests to leave out.
        force: overwrite.
        known: every error source by name, for a file of a model.
        provenance: asked, when all is read, where the report comes from.
        progress: told each stage.
        stop: asked at each stage whether to stop.

    Raises:
        InputError: faults of files.
        OutputError: a file exists and `force` is not given; no browser prints.
        ModelError: the model is of another machine.
        StoppedError: `stop` returned True; nothing was written.
    """
    page, paper = Path(out), None if pdf is None else Path(pdf)
    refuse_outputs([page, paper], force=force)
    browser = None if paper is None else chromium()
    telling = Telling(progress, stop)
    identified = None if model is None else model_of(model, known)
    paths = paths_of(sessions)
    found = load_circles(
        paths, TOLERATED, tests, exclude, findings=True, model=identified, progress=telling.counted("circles")
    )
    former = None
    if before is not None:
        former = load_circles([Path(before)], TOLERATED, progress=telling.counted("circles before"))
    modelled = None
    if identified is not None:
        for session in found.sessions:
            check_model_is_of(session.machine, identified.model.machine)
        modelled = _modelled(paths, identified, (tests, exclude), telling)
    reported = Reported(found, TOLERATED, settings, coverage_factor, former, modelled, job)
    numbers = numbers_of(reported)
    telling.stage("writing")
    html = report_html(content_of(reported, numbers, provenance()))
    write_bytes(page, html, force=force)
    if paper is not None and browser is not None:
        telling.stage("printing")
        write_bytes(paper, printed(html, browser), force=force)
    return WrittenReport(page, paper, numbers)


def _modelled(
    paths: Sequence[Path], identified: IdentifiedModel, chosen: tuple[Sequence[str], Sequence[str]], telling: Telling
) -> Modelled:
    """Return what a model leaves; a run that it cannot take leaves the report without that, and says so.

    Args:
        paths: of the sessions.
        identified: the model.
        chosen: tests to take, and to leave out.
        telling: told each stage.
    """
    tests, exclude = chosen
    try:
        found = evaluate(paths, identified, tests=tests, exclude=exclude, progress=telling.stage)
    except StoppedError:
        raise
    except StationError as error:
        return Modelled(identified, {}, str(error))
    return Modelled(identified, {key: value for key, value in plain(found).items() if key != "tolerances"})
