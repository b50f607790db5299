"""Read the figures of a history from one session folder or model file."""

from __future__ import annotations

import hashlib
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

from dbbstation.circles.budget import budgets
from dbbstation.circles.estimates import BudgetQuantity
from dbbstation.circles.path import TOLERATED
from dbbstation.files.formats.model import read_model
from dbbstation.files.formats.session import starts_of
from dbbstation.files.gateway import digest_of
from dbbstation.files.inputs import input_book
from dbbstation.files.own_sources import every_source
from dbbstation.files.recordings.event_log import anchor_of
from dbbstation.history.order import moment_words
from dbbstation.history.record import Figure, ModelFigures, ModelParameter, RunFigures, SessionFigures
from dbbstation.model.identified import values_of_machine
from dbbstation.plan.tolerance import CircleFigure
from dbbstation.results.model_warnings import model_warnings
from dbbstation.results.tolerances import tolerated_circles
from dbbstation.tasks.circle_runs import load_circles

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from dbbstation.files.formats.session import RunEntry
    from dbbstation.files.recordings.session import SessionFolder
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.plan.plan import Circle
    from dbbstation.results.circles import MeasuredCircle
    from dbbstation.results.tolerances import ToleratedCircle


def session_figures(folder: Path) -> SessionFigures:
    """Read a session and compute the figures of accepted runs.

    Raises:
        InputError: every fault of its files; or no accepted run.
    """
    with input_book():  # recordings are inputs of what is kept, not of the command that happens to read them
        found = load_circles([folder], TOLERATED)
    session = found.sessions[0]
    runs = run_figures(found.shown)
    moments = starts_of(one.entry for one in found.circles)
    return SessionFigures(
        name=session.name,
        sha256=session.sha256,
        # Virtual and real circles never stand in one chart.
        machine=("virtual " if session.virtual else "") + (session.serial_number or session.machine.name),
        started=min(moments, default=None),
        runs=runs,
        bar="" if session.bar is None else session.bar.serial_number,
        programs=_programs([one.entry for one in found.circles]),
        notes=(
            *(note.removeprefix(f"{session.name}: ") for note in found.warnings),
            *_clock(session.runs),
            *_lacks(session, found.circles),
        ),
        anchor=anchor_of(session.seal),
    )


def run_figures(circles: Sequence[MeasuredCircle]) -> tuple[RunFigures, ...]:
    """Return the comparable figures of runs that show a circle."""
    return tuple(map(_figures, circles, tolerated_circles(circles)))


def _figures(one: MeasuredCircle, tolerated: ToleratedCircle) -> RunFigures:
    analysis = one.analysed
    known = budgets(analysis, one.known, (BudgetQuantity.X, BudgetQuantity.Y))
    x_mm, y_mm = analysis.centre_mm
    g, centre, radial = (
        tolerated.sizes[figure]
        for figure in (CircleFigure.CIRCULAR_DEVIATION, CircleFigure.CENTRE_DEVIATION, CircleFigure.MEAN_RADIAL_ERROR)
    )
    x, y = (known[quantity] for quantity in (BudgetQuantity.X, BudgetQuantity.Y))
    return RunFigures(
        test=one.entry.test,
        direction=str(one.entry.direction),
        circle=_in_words(analysis.raw.circle),
        figures=(
            Figure("G", g.um, g.u_um),
            Figure("X", 1e3 * x_mm, x.u_um),
            Figure("Y", 1e3 * y_mm, y.u_um),
            Figure("R", analysis.mean_radial_error_um, radial.u_um),
            Figure("C", centre.um, centre.u_um),
        ),
    )


def _as_printed(parameter: ModelParameter) -> ModelParameter:
    name = parameter.name.removesuffix("_mm").replace("_", " ")
    if parameter.unit != "mm":
        return replace(parameter, name=name)
    u_um = None if parameter.u is None else 1e3 * parameter.u
    return replace(parameter, name=name, value=1e3 * parameter.value, u=u_um, unit="µm")


def _in_words(circle: Circle) -> str:
    place = " ".join(f"{axis}{round(value)}" for axis, value in zip("XYZ", circle.ball_mm, strict=True))
    tilt = " ".join(f"{axis}{value:g}" for axis, value in zip("ABC", circle.tilt_deg, strict=True) if value)
    raised = f", bar raised {circle.elevation_deg:g}°" if circle.elevation_deg else ""
    return f"bar {circle.bar_mm:g} mm at {place}{', ' + tilt if tilt else ''}{raised}, {circle.feed_mm_min:g} mm/min"


def _programs(runs: Iterable[RunEntry]) -> str:
    found = sorted({run.program.model_sha256 or run.program.sha256 for run in runs if run.program is not None})
    return hashlib.sha256("\n".join(found).encode()).hexdigest()[:16] if found else ""


def _clock(runs: Sequence[RunEntry]) -> list[str]:
    dated = [run for run in runs if run.started is not None]
    return [
        f"run {after.label} is dated {moment_words(after.started)}, before run {before.label} that was started earlier: was the "
        "clock set while it was measured?"
        for before, after in pairwise(dated)
        if before.started is not None and after.started is not None and after.started < before.started
    ]


def _lacks(session: SessionFolder, circles: Sequence[MeasuredCircle]) -> list[str]:
    found = []
    directions = Counter(str(one.entry.direction) for one in circles)
    if len(directions) == 1:
        found.append(f"all its runs are {next(iter(directions))}")
    warm = any(one.analysis is not None and one.analysis.raw.temperature_degc for one in circles)
    if session.ambient_temp_c is None and not warm:
        found.append("no temperature is noted: U lacks what the bar has grown by")
    if not session.serial_number:
        found.append(f"no serial number is noted: it counts for a machine called {session.machine.name}")
    return found


def model_figures(path: Path, source_files: Sequence[Path] = ()) -> ModelFigures:
    """Read the machine's parameters of a model.

    Raises:
        InputError: every fault of the file.
    """
    with input_book():
        identified = read_model(path, every_source(source_files))
    told = model_warnings(identified)
    return ModelFigures(path.name, digest_of(path), dict(identified.sessions), machine_parameters(identified), told)


def machine_parameters(identified: IdentifiedModel) -> tuple[ModelParameter, ...]:
    """Return the machine's parameters, with uncertainties of differences between sessions."""
    known = identified.uncertainties_between_sessions
    return tuple(
        _as_printed(ModelParameter(source, one.name, value, u or None, one.unit))  # zero: held at nominal
        for source, one, value, u in values_of_machine(identified.model, known)
    )
