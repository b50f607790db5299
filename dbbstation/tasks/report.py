"""Report measured circles against the shop's tolerances, as one HTML file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from dbbstation.diagnosis.effects import effects_of
from dbbstation.diagnosis.thinned import thinned
from dbbstation.errors import StationError
from dbbstation.files.atomic import refuse_outputs, write_bytes
from dbbstation.files.inputs import in_a_book
from dbbstation.files.provenance import from_python
from dbbstation.files.recordings.session import read_session
from dbbstation.machine.difference import check_model_is_of
from dbbstation.report.content import Modelled, Reported, certified_of, content_of, numbers_of
from dbbstation.report.html import report_html
from dbbstation.report.pdf import chromium, printed
from dbbstation.results.model_warnings import lacks_physics
from dbbstation.results.ranked import Ranked
from dbbstation.results.tolerances import TOLERATED
from dbbstation.tasks.circle_runs import load_circles
from dbbstation.tasks.evaluate import evaluate
from dbbstation.tasks.load import READING, load_sessions, paths_of
from dbbstation.tasks.models import model_of
from dbbstation.tasks.telling import StoppedError, Telling, never, silent

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from os import PathLike

    from dbbstation.files.formats.settings import Settings
    from dbbstation.files.provenance import Provenance
    from dbbstation.files.recordings.session import SessionFolder
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.results.report import ReportResult
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.load import Recorded, Sessions
    from dbbstation.tasks.models import Model
    from dbbstation.tasks.telling import Progress

STAGES = {
    "circles": 0,
    "circles before": 40,
    "reading runs": 60,
    "predicting runs": 75,
    "effects of causes": 82,
    "writing": 90,
    "printing": 95,
}
"""Stages of a report, and the share of its time that has passed by then [%]."""

USUAL_COVERAGE = 2.0


@in_a_book
def report(
    sessions: Sessions,
    out: str | PathLike[str],
    *,
    settings: Settings,
    before: str | PathLike[str] | None = None,
    model: Model | None = None,
    job: str = "",
    place: str = "",
    certificate: bool = False,
    pdf: str | PathLike[str] | None = None,
    coverage_factor: float = USUAL_COVERAGE,
    tests: Sequence[str] = (),
    exclude: Sequence[str] = (),
    force: bool = False,
    known: Mapping[str, ErrorSource] | None = None,
    provenance: Callable[[], Provenance] = from_python,
    progress: Progress = silent,
    stop: Callable[[], bool] = never,
) -> ReportResult:
    """Write a report as one HTML file that needs no network and prints to A4.

    Args:
        settings: with tolerances.
        before: earlier session for comparison.
        model: a model, its file, or the result of `calibrate` or `diagnose`.
        job: if the session states none or another.
        certificate: refuse a report that is no certificate.
        pdf: file, printed by an installed Chromium; None: none.
        tests: names; empty for all.

    Raises:
        InputError: faults of files.
        OutputError: a file exists without `force`; no browser prints.
        ModelError: the model is of another machine.
        StationError: `certificate` is set and something is missing; nothing was written.
        StoppedError: `stop` returned True; nothing was written.
    """
    page, paper = Path(out), None if pdf is None else Path(pdf)
    refuse_outputs([page, paper], force=force)
    browser = None if paper is None else chromium()
    telling = Telling(progress, stop)
    identified = None if model is None else model_of(model, known)
    # Circles, evaluation and ranking need the same recordings: each is read once.
    now = [read_session(path, keeps=identified is not None) for path in paths_of(sessions)]
    then = None if before is None else read_session(Path(before), keeps=identified is not None)
    found = load_circles(
        now, TOLERATED, tests, exclude, findings=True, model=identified, progress=telling.counted("circles")
    )
    former = None
    if then is not None:
        former = load_circles([then], TOLERATED, progress=telling.counted("circles before"))
    modelled = ranked = None
    if identified is not None:
        for session in found.sessions:
            check_model_is_of(session.machine, identified.model.machine)
        runs = _read(now, (tests, exclude), telling)
        modelled = _modelled(runs, identified, telling)
        if lacks_physics(identified.report):
            ranked = Ranked(why_not=_PHYSICS_MISSING)
        else:
            nominal = now if then is None else [then]
            of_them = runs if then is None else _read(nominal, (tests, exclude), telling)
            ranked = _ranked(of_them, [session.name for session in nominal], identified, telling)
    reported = Reported(found, TOLERATED, settings, coverage_factor, former, modelled, job, ranked, place)
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
    html = report_html(numbers, content_of(reported, numbers, provenance()))
    write_bytes(page, html, force=force)
    if paper is not None and browser is not None:
        telling.stage("printing")
        write_bytes(paper, printed(html, browser), force=force)
    return replace(numbers, pdf=paper)


_PHYSICS_MISSING = (
    "Physics is missing from the model: its causes cannot be ranked. `dbbstation diagnose` looks for what it lacks."
)


def _read(
    sessions: Sequence[SessionFolder], chosen: tuple[Sequence[str], Sequence[str]], telling: Telling
) -> Recorded | StationError:
    tests, exclude = chosen
    try:
        found = load_sessions(sessions, exclude, telling.counted(READING), tests)
    except StoppedError:
        raise
    except StationError as error:
        return error
    telling.note(*found.warnings)
    return found


def _modelled(runs: Recorded | StationError, identified: IdentifiedModel, telling: Telling) -> Modelled:
    """Return a model's residual, with a note on unsuitable runs."""
    if isinstance(runs, StationError):
        return Modelled(identified, None, str(runs))
    try:
        found = evaluate(runs, identified, progress=telling.stage)
    except StoppedError:
        raise
    except StationError as error:
        return Modelled(identified, None, str(error))
    return Modelled(identified, replace(found, tolerances=None, notes=(*found.notes, *runs.warnings)))


def _ranked(
    recorded: Recorded | StationError, names: Sequence[str], identified: IdentifiedModel, telling: Telling
) -> Ranked:
    """Return each cause's contribution under nominal programs, with a note on unsuitable sessions."""
    telling.stage("effects of causes")
    try:
        if isinstance(recorded, StationError):
            raise recorded
        if any(one.commanded is not None for one in recorded.observations):
            return Ranked(
                why_not="The circles ran under compensated programs or a correcting control, in which the model's causes are taken out already: `--before` ranks them on the "
                "circles before."
            )
        runs = [thinned(one) for one in recorded.observations]
        found = effects_of(
            identified.model,
            runs,
            identified.covariance_rows,
            identified.covariance,
            identified.null_space,
            identified.formula_variance,
        )
    except StoppedError:
        raise
    except StationError as error:
        return Ranked(why_not=f"What the model's causes contribute could not be worked out: {error}")
    if not found:
        return Ranked(why_not="The model has no cause that acts on these circles.")
    said = identified.report.get("diagnosis")
    said = said if isinstance(said, Mapping) else {}
    told, picture = (tuple(str(one) for one in said.get(name, ())) for name in ("said", "picture"))
    verdicts = said.get("verdicts", {})
    effects = tuple(replace(one, verdict=verdicts.get(one.cause, "")) for one in found)
    return Ranked(", ".join(dict.fromkeys(names)), effects, said=told, picture=picture)
