"""Calibrate: fit a model of the machine to recorded sessions."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

from dbbstation.errors import ModelError
from dbbstation.facts import of_facts
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Names, Option, drawing, paths_of, task
from dbbstation.tasks.telling import Telling

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Unpack

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.calibration.fit.directions import Name
    from dbbstation.calibration.fit.methods import Method
    from dbbstation.model.observation import Observation
    from dbbstation.results.calibration import CalibrationResult
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.load import Recorded
    from dbbstation.tasks.telling import Hooks

STAGES = {"fit": 0, "figures": 36, "observability": 53}
"""Stages of a calibration after reading, and the share of its time that has passed at each begin [%]; there are one or
several fits."""


@task("calibrate", label="calibration", stages=STAGES)
def calibrate(
    sessions: o.RecordedSessions,
    *,
    sources: Annotated[Names | None, replace(o.SOURCES, usual="strut-reference-length,base-joints")] = None,
    source_files: o.SourceFiles = (),
    law_over_time: o.LawOverTime = False,
    method: o.Method = "jig",
    prescribe: Annotated[
        Names | None,
        Option("Parameters to hold at nominal, as many as the tests cannot identify.", metavar="SOURCE.PARAMETER,..."),
    ] = None,
    tests: o.Tests = (),
    exclude: o.Exclude = (),
    known: Mapping[str, ErrorSource] | None = None,
    **hooks: Unpack[Hooks],
) -> CalibrationResult:
    r"""Fit the machine's errors to the raw circles of one or more sessions.

    Fits 24 kinematic parameters: the reference lengths of the struts and the positions of the base joints. The scatter
    of mountings, CMM and bar enters the fit as random effects. Combinations of parameters that the tests cannot
    identify are named and held at nominal. Balls and runs that are outliers are named and kept out of the fit.

    Use --method conv-a or conv-b if the balls were put up under the spindle, at unknown positions. Six combinations of
    parameters cannot be identified then. The program chooses six parameters and holds them at nominal; --prescribe
    chooses others.

    With drive-friction among the sources, recorded motor currents are fitted too. They give gains and friction of the
    drives, and with cog-shift the centre of gravity.

    \b
    Examples:
      dbbstation calibrate 2026-11-20-hexapod-7
      dbbstation calibrate 2026-11-20-hexapod-7 --out hexapod-7.yaml --figure circles.svg
      dbbstation calibrate monday tuesday --exclude g --json
      dbbstation calibrate standard-test --method conv-a
      dbbstation calibrate monday --sources strut-reference-length,base-joints,gravity,cog-shift,drive-friction
      dbbstation calibrate monday --source-files scale_bow.py --sources strut-reference-length,base-joints,scale-bow

    Args:
        known: error sources by name; None: those of package, installed packages and `source_files`.

    Returns:
        The model with the figures of its fit; `drawing` draws them.

    Raises:
        ArgumentError: a value that it does not take.
        InputError: faults of files and traces.
        ModelError: an unknown source, or one that belongs to no machine or has no effect on circles.
        CalibrationError: too few tests, or the fit does not converge.
        StoppedError: `stop` returned True.
    """
    from dbbstation.calibration.fit.calibrate import KINEMATIC_SOURCES, MEASUREMENT_SOURCES, machine_sources
    from dbbstation.calibration.fit.calibrate import calibrate as fit
    from dbbstation.calibration.fit.methods import Method, as_known
    from dbbstation.calibration.outliers.robust import calibrate_robust
    from dbbstation.calibration.reporting.evaluation import evaluate
    from dbbstation.calibration.reporting.figures import calibration_figures, covariance_of, identified_model, report_of
    from dbbstation.files.own_sources import every_source, sources_of
    from dbbstation.model.identified import greatest_u_um
    from dbbstation.results.calibration import CalibrationResult
    from dbbstation.sources.registry import sources_named
    from dbbstation.tasks.load import loaded

    telling = Telling(**hooks)
    way = Method(method)
    chosen = KINEMATIC_SOURCES if sources is None else tuple(sources)
    if known is None:
        known = every_source(paths_of(source_files))
        unused = set(sources_of(paths_of(source_files), known)) - set(chosen)
        telling.note(*(f"{name} is known now, but not fitted: name it with --sources" for name in unused))
    fitted = sources_named(dict.fromkeys(chosen + MEASUREMENT_SOURCES), known)
    if not machine_sources(fitted):
        raise ModelError(
            "no named error source belongs to the machine and appears in circles: nothing can be calibrated",
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
    return of_facts(
        CalibrationResult,
        figures,
        method=str(way),
        centre_u_um=greatest_u_um(model, [one.standing_pose for one in runs]),
        covariance=covariance_of(model),
        model=model,
        recorded=recorded,
        drawing=drawing("calibration_figure", calibration),
        notes=tuple(telling.notes),
    )


def _prescribed(names: Sequence[str] | None, method: Method) -> list[Name] | None:
    from dbbstation.calibration.fit.methods import Method

    if names is None:
        return None if method is Method.JIG else []
    parts = [name.partition(".") for name in names]
    return [(source, parameter) for source, _, parameter in parts]


def _following_thermometers(
    fitted: tuple[ErrorSource, ...], recorded: Recorded, telling: Telling
) -> tuple[ErrorSource, ...]:
    from dbbstation.model.observation import Motions
    from dbbstation.sources.laws.temperature import following_thermometers

    forms = following_thermometers(fitted, Motions(recorded.observations))
    telling.note(
        *(
            f"{form.name} follows the logged temperatures, not a law over time (--law-over-time)"
            for source, form in zip(fitted, forms, strict=True)
            if form is not source
        )
    )
    return forms
