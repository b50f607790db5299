"""Work on one session of a fleet, in any process."""

from __future__ import annotations

import shlex
import tempfile
from collections import defaultdict
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.errors import InputError, StationError
from dbbstation.facts.serialise import plain
from dbbstation.files.formats.model import model_text
from dbbstation.files.formats.settings import Settings
from dbbstation.files.gateway import content_of, digest_of
from dbbstation.files.inputs import input_book
from dbbstation.files.own_sources import every_source
from dbbstation.files.places import name_of
from dbbstation.files.provenance import Provenance, made_by
from dbbstation.files.recordings.former import reason_of
from dbbstation.results.fleet import FleetCause, FleetFound, FleetValue
from dbbstation.results.words import outlier_sentence
from dbbstation.tasks.calibrate import calibrate
from dbbstation.tasks.called import words_of
from dbbstation.tasks.circles import circles
from dbbstation.tasks.diagnose import diagnose
from dbbstation.tasks.executors import refuse_other_program
from dbbstation.tasks.report import report
from dbbstation.tasks.session_figures import machine_parameters, run_figures

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.history.record import RunFigures
    from dbbstation.model.identified import IdentifiedModel


@dataclass(frozen=True)
class FleetOptions:
    """Options for every session.

    Attributes:
        given: arguments of the task by name.
    """

    given: Mapping[str, Any] = field(default_factory=dict)
    source_files: tuple[Path, ...] = ()
    settings: Settings = field(default_factory=Settings)


@dataclass(frozen=True)
class FleetPiece:
    """One session to work on."""

    task: str
    folder: Path
    options: FleetOptions
    inputs: Mapping[str, str]
    program: dict[str, str]


@dataclass(frozen=True)
class Worked:
    """Result of a piece of work."""

    problem: str = ""
    found: Mapping[str, Any] = field(default_factory=dict)
    result: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, bytes] = field(default_factory=dict)


def worked(piece: FleetPiece) -> Worked:
    """Run a task on one session and return its result or failure.

    Raises:
        SchedulerError: this process runs another program.
    """
    refuse_other_program(piece.program, "the process that asks")
    try:
        _refuse_other_inputs(piece.inputs)
        with input_book():
            found, result, files = TASKS[piece.task](piece)
    except (StationError, OSError) as error:
        return Worked(reason_of(error) if isinstance(error, OSError) else str(error))
    except Exception as error:  # noqa: BLE001 - a fault of ours in one session must not cost the others
        return Worked(f"{type(error).__name__}: {error} (this is a fault of dbbstation itself)")
    return Worked("", asdict(found), result, files)


def _refuse_other_inputs(inputs: Mapping[str, str]) -> None:
    for path, digest in inputs.items():
        if digest_of(Path(path)) != digest:
            what = "this file is another one where the work is done, or was changed since"
            raise InputError.of(path, what, "share one folder with all computers, under one path")


Done = tuple[FleetFound, "dict[str, object]", "dict[str, bytes]"]


def _calibrated(piece: FleetPiece) -> Done:
    options = piece.options
    result = calibrate(piece.folder, **options.given, known=every_source(options.source_files))
    figures = (
        _size("noise of one reading", result.noise_um),
        _size("residual within mountings", result.residual_within_mounting_rms_um),
        _size("nominal machine leaves", result.nominal_rms_um),
    )
    misfit = (
        f"{result.misfit.rms_um:.2f} µm rms unexplained" if result.misfit.missing_physics else "nothing unexplained"
    )
    headline = (
        f"{result.parameters_identified} parameters, {result.residual_within_mounting_rms_um:.2f} µm rms left, {misfit}"
    )
    parameters = (FleetValue("parameter", *number) for _, *number in _numbers(result.model))
    notes = (*result.notes, *map(outlier_sentence, result.outliers))
    found = FleetFound((*parameters, *figures), (), headline, notes)
    return found, plain(result), {".yaml": model_text(result.model, _provenance(piece)).encode()}


def _diagnosed(piece: FleetPiece) -> Done:
    options = piece.options
    result = diagnose(piece.folder, **options.given, known=every_source(options.source_files))
    figures = [
        _size("noise of one reading", result.noise_um),
        _size("residual within mountings", result.residual_rms_um.after),
        _size("error in held-out tests", result.held_out_rms_um.after),
    ]
    causes = tuple(FleetCause(one.name, one.verdict, one.probability) for one in result.sources)
    named = [one.name for one in result.sources if one.verdict in {"identified", "happened"}]
    headline = f"found: {', '.join(named)}" if named else "no cause found"
    if result.mismatch and not named:
        headline += f", {result.misfit_rms_um:.2f} µm rms without a name"
    of_causes = {one.name for one in result.sources if one.verdict == "identified"}
    parameters = [
        FleetValue("cause" if source in of_causes else "parameter", *number)
        for source, *number in _numbers(result.model)
    ]
    notes = (*result.notes, *map(outlier_sentence, result.outliers))
    found = FleetFound((*parameters, *figures), causes, headline, notes)
    return found, plain(result), {".yaml": model_text(result.model, _provenance(piece)).encode()}


def _circles(piece: FleetPiece) -> Done:
    result = circles(piece.folder, **piece.options.given)
    runs = run_figures(result.circles.shown)
    worst = max(
        (one for run in runs for one in run.figures if one.name == "G"), key=lambda one: one.value_um, default=None
    )
    headline = f"{len(runs)} circles" + ("" if worst is None else f", G up to {worst.value_um:.1f} µm")
    return FleetFound(_of_circles(runs), (), headline, result.notes), plain(result), {}


def _reported(piece: FleetPiece) -> Done:
    options = piece.options
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "report.html"
        provenance = partial(_provenance, piece)
        written = report(piece.folder, page, settings=options.settings, **options.given, provenance=provenance)
        html = content_of(page)
    numbers = plain(written)
    del numbers["report"]  # a folder that is gone
    return FleetFound((), (), written.verdict.headline, ()), numbers, {".html": html}


TASKS = {"calibrate": _calibrated, "circles": _circles, "diagnose": _diagnosed, "report": _reported}
"""Tasks for every session, by name."""


def _provenance(piece: FleetPiece) -> Provenance:
    task = {"calibrate": calibrate, "circles": circles, "diagnose": diagnose, "report": report}[piece.task]
    files = {"source_files": piece.options.source_files} if piece.options.source_files else {}
    words = words_of(task, {**piece.options.given, **files})
    return made_by(shlex.join(["dbbstation", piece.task, name_of(piece.folder), *words]))


def _size(name: str, value_um: float) -> FleetValue:
    return FleetValue("figure", name, "µm", value_um, logarithmic=True)


def _numbers(model: IdentifiedModel) -> list[tuple[Any, ...]]:
    return [
        (one.source, f"{one.source}: {one.name}", one.unit, one.value, one.u)
        for one in machine_parameters(model)
        if one.u is not None
    ]


LOGARITHMIC = frozenset({"G"})
"""Figures of circles that are positive, so that ratios are compared."""

COMPARED = ("G", "X", "Y", "R")
"""Figures of circles for the comparison of machines; X and Y already contain the distance of the centre."""


def _of_circles(runs: Sequence[RunFigures]) -> tuple[FleetValue, ...]:
    """Return means of figures, and of their standard uncertainties, over repeats."""
    grouped: dict[tuple[str, str, str, str], list[tuple[float, float]]] = defaultdict(list)
    for run in runs:
        for figure in run.figures:
            if figure.name in COMPARED:
                same = grouped[figure.name, run.test, run.direction, run.circle]
                same.append((figure.value_um, figure.stated_u_um))
    values = []
    for (name, test, direction, circle), repeats in grouped.items():
        value, u = np.mean(repeats, axis=0).tolist()
        quantity = f"{name} {test} {direction}"
        values.append(FleetValue("figure", quantity, "µm", value, u if u > 0.0 else None, circle, name in LOGARITHMIC))
    return tuple(values)
