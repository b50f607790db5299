"""Calibrate: from recorded sessions to a model of the machine."""

from __future__ import annotations

from dataclasses import fields
from functools import partial
from typing import TYPE_CHECKING

from dbbstation.calibration.fit.calibrate import (
    KINEMATIC_SOURCES,
    MEASUREMENT_SOURCES,
    Calibration,
    machine_sources,
)
from dbbstation.calibration.fit.calibrate import calibrate as fit
from dbbstation.calibration.fit.methods import Method, as_known
from dbbstation.calibration.outliers.robust import calibrate_robust
from dbbstation.calibration.reporting.evaluation import evaluate
from dbbstation.calibration.reporting.figures import calibration_figures, covariance_of, report_of
from dbbstation.calibration.reporting.identified import identified_model
from dbbstation.errors import ModelError
from dbbstation.files.own_sources import every_source
from dbbstation.model.observation import Motions
from dbbstation.results.calibration import CalibrationResult
from dbbstation.sources.laws.by_temperature import following_thermometers
from dbbstation.sources.registry import sources_named
from dbbstation.tasks.load import loaded
from dbbstation.tasks.telling import Telling, never, silent

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from dbbstation.calibration.fit.prescription import Name
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.load import Recorded, Sessions
    from dbbstation.tasks.telling import Progress

STAGES = {"fit": 0, "figures": 36, "observability": 53}
"""Stages of a calibration once runs are read, and the share of its time that has passed by then [%]; fits are one or several."""


def calibrate(
    sessions: Sessions | Recorded,
    *,
    sources: Sequence[str] | None = None,
    method: str = "jig",
    prescribe: Sequence[str] | None = None,
    tests: Sequence[str] = (),
    exclude: Sequence[str] = (),
    law_over_time: bool = False,
    known: Mapping[str, ErrorSource] | None = None,
    progress: Progress = silent,
    stop: Callable[[], bool] = never,
    say: Callable[[str], None] = silent,
) -> CalibrationResult:
    """Fit the machine's errors to the raw circles of one or more sessions.

    Scatter of mountings, CMM and bar enters as random effects. Unidentifiable combinations of parameters are named and
    held at nominal. Outlying balls and runs are named and left out.

    Args:
        sessions: folders, or the result of `load`.
        sources: names; None: reference lengths of the struts and base joints.
        method: ball positions: from a CMM sheet (`jig`), unknown (`conv-a`), from micrometer readings (`conv-b`).
        prescribe: parameters to hold, as `source.parameter`, as many as are unidentifiable; None: `jig` holds the directions
            themselves, else the program chooses.
        tests: names; empty for all.
        exclude: names of tests.
        law_over_time: fit thermal growth over time, despite logged temperatures.
        known: error sources by name; None: those of package and installed packages.
        progress: called with each stage.
        stop: asked at each stage.
        say: called with notes.

    Returns:
        The model with the figures of its fit; `drawing` draws them.

    Raises:
        InputError: faults of files and traces.
        ModelError: an unknown source, or one that belongs to no machine or does not show in circles.
        CalibrationError: too few tests, or the fit does not converge.
        StoppedError: `stop` returned True.
    """
    telling = Telling(progress, stop, say)
    way = Method(method)
    chosen = KINEMATIC_SOURCES if sources is None else tuple(sources)
    fitted = sources_named(dict.fromkeys(chosen + MEASUREMENT_SOURCES), every_source() if known is None else known)
    if not machine_sources(fitted):
        raise ModelError(
            "none of the error sources named belongs to the machine and shows in circles: there is nothing to calibrate",
            remedy=f"name one such as {KINEMATIC_SOURCES[0]}, or leave --sources out",
        )
    recorded = loaded(sessions, tests, exclude, telling)
    if not law_over_time:
        fitted = _following_thermometers(fitted, recorded, telling)
    held = _prescribed(prescribe, way)

    def fit_told(some: Sequence[Observation]) -> Calibration:
        telling.stage(f"fit of {len(some)} runs")
        return fit(recorded.machine, some, fitted, prescribe=held)

    runs = as_known(way, recorded.machine, recorded.observations)
    calibration, outliers = calibrate_robust(fit_told, runs)
    telling.stage("figures of circles")
    evaluated = evaluate(calibration.model, runs)
    telling.stage("observability")
    figures = calibration_figures(calibration, evaluated, outliers)
    model = identified_model(calibration, report_of(figures, method=str(way)), recorded.sessions)
    return CalibrationResult(
        **{one.name: getattr(figures, one.name) for one in fields(figures)},
        method=str(way),
        covariance=covariance_of(model),
        model=model,
        drawing=partial(_drawn, calibration),
        notes=tuple(telling.notes),
    )


def _drawn(calibration: Calibration, wanted: object) -> bytes:
    from dbbstation.report.calibration_figure import calibration_figure  # noqa: PLC0415 - half a second for who draws nothing
    from dbbstation.report.figure_format import figure_format  # noqa: PLC0415

    return calibration_figure(calibration, figure_format(wanted))


def _prescribed(names: Sequence[str] | None, method: Method) -> list[Name] | None:
    """Return named parameters, or by method the directions themselves or the program's choice."""
    if names is None:
        return None if method is Method.JIG else []
    parts = [name.partition(".") for name in names]
    return [(source, parameter) for source, _, parameter in parts]


def _following_thermometers(
    fitted: tuple[ErrorSource, ...], recorded: Recorded, telling: Telling
) -> tuple[ErrorSource, ...]:
    """Return sources that grow with logged temperatures instead of time, with a note."""
    forms = following_thermometers(fitted, Motions(recorded.observations))
    telling.note(
        *(
            f"{form.name} follows the logged temperatures, not a law over time (--law-over-time)"
            for source, form in zip(fitted, forms, strict=True)
            if form is not source
        )
    )
    return forms
