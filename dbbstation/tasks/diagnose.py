"""Diagnose: find physics beyond a kinematic calibration in recorded sessions."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from dbbstation.errors import CalibrationError
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Names, task
from dbbstation.tasks.telling import Telling

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Unpack

    from dbbstation.diagnosis.findings import Diagnosis
    from dbbstation.diagnosis.unexplained import JointFitWithCurve
    from dbbstation.results.diagnosis import DiagnosisResult
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.telling import Hooks

STAGES = {
    "kinematic calibration": 0,
    "candidates": 10,
    "joint fit": 45,
    "verdicts": 75,
    "held-out tests": 77,
    "next test": 80,
    "effects of causes": 95,
}
"""Stages of a diagnosis after reading, and the share of its time that has passed at each begin [%]; there may be
several joint fits."""


@task("diagnose", label="diagnosis", stages=STAGES)
def diagnose(
    sessions: o.RecordedSessions,
    *,
    sources: Annotated[Names | None, replace(o.SOURCES, usual="all")] = None,
    source_files: o.SourceFiles = (),
    tests: o.Tests = (),
    exclude: o.Exclude = (),
    held_out: o.HeldOut = True,
    until_interrupted: bool = False,
    known: Mapping[str, ErrorSource] | None = None,
    **hooks: Unpack[Hooks],
) -> DiagnosisResult:
    r"""Find the physics that a kinematic calibration of these recordings leaves out, name it and model it.

    A calibration can absorb gravity, drift or play in its joint positions. The residual of these tests is then small,
    but the machine errs elsewhere. This command compares sets of causes. It fits each set together with the kinematic
    parameters and gives the probability of each cause, given the catalogue of causes. Verdicts: identified (probability
    of at least 0.95, size of at least five standard deviations, better predictions of held-out tests), happened (acts
    once), does-not-predict, ambiguous, ruled-out, not-testable.

    The model also keeps an effect of unknown cause over strut length or force, if other tests confirm it.

    \b
    Examples:
      dbbstation diagnose 2026-11-20-hexapod-7
      dbbstation diagnose 2026-11-20-hexapod-7 --out joint.yaml --figure diagnosis.svg
      dbbstation diagnose 2026-11-20-hexapod-7 --sources gravity,backlash --json
      dbbstation diagnose 2026-11-20-hexapod-7 --effects
      dbbstation diagnose 2026-11-20-hexapod-7 --source-files scale_bow.py

    Args:
        until_interrupted: a KeyboardInterrupt ends the comparison with the best set so far.
        known: error sources by name; None: those of package, installed packages and `source_files`.

    Returns:
        Causes with their verdicts, and the joint model; `drawing` draws them.

    Raises:
        ArgumentError: a value that it does not take.
        InputError: faults of files and traces.
        ModelError: an unknown source, or one that is no cause.
        CalibrationError: the kinematic model cannot be fitted.
        StoppedError: `stop` returned True.
    """
    import numpy as np

    from dbbstation.calibration.reporting.evaluation import evaluate
    from dbbstation.calibration.reporting.figures import calibration_figures, identified_model, report_of
    from dbbstation.diagnosis import diagnose as search
    from dbbstation.diagnosis.effects import effects_of
    from dbbstation.facts import of_facts
    from dbbstation.results.diagnosis import DiagnosisResult, diagnosis_figures, kept_of
    from dbbstation.tasks.diagnosed import diagnosed_of
    from dbbstation.tasks.models import sources_known

    telling = Telling(**hooks)
    every = sources_known(known, source_files)
    how = partial(search.diagnose, hold_out=held_out, until_interrupted=until_interrupted)
    diagnosed = diagnosed_of(sessions, sources, (tuple(tests), tuple(exclude)), every, telling, how)
    found = diagnosed.diagnosis
    unnamed = _unnamed(found)
    kept = found.after if unnamed is None else unnamed.fit
    figures = diagnosis_figures(found, diagnosed.lacking)
    report = report_of(calibration_figures(kept, evaluate(kept.model, kept.observations)), diagnosis=kept_of(figures))
    of_sessions = diagnosed.recorded.sessions
    model = identified_model(kept, report, of_sessions) if unnamed is None else unnamed.identified(report, of_sessions)
    telling.stage("effects of causes")
    fit = found.after
    names = fit.layout.names
    of_formulas = fit.layout.formula_variance(fit.x)
    covariance = fit.solution.covariance + np.diag(of_formulas)
    effects = effects_of(fit.model, fit.observations, names, covariance, fit.null_space, of_formulas)
    verdicts = {one.name: str(one.verdict) for one in figures.sources}
    return of_facts(
        DiagnosisResult,
        figures,
        effects=tuple(replace(one, verdict=verdicts.get(one.cause, "")) for one in effects),
        model=model,
        drawing=partial(_drawn, found),
        notes=tuple(telling.notes),
        recorded=diagnosed.recorded,
    )


def _unnamed(found: Diagnosis) -> JointFitWithCurve | None:
    """Return the fit with an effect of unknown cause that other tests confirm, or None."""
    from dbbstation.diagnosis.unexplained import KEPT_AS, keep_unexplained

    curve = found.unexplained.curve
    if curve is None or curve.follows not in KEPT_AS or curve.follows.variable not in found.levels.corrects:
        return None
    try:
        return keep_unexplained(curve, found.after)
    except CalibrationError:
        return None


def _drawn(diagnosis: Diagnosis, wanted: object) -> Any:  # noqa: ANN401 - as asked for
    from dbbstation.diagnosis.source_curves import gains_by_test, source_curves
    from dbbstation.report.diagnosis_figure import diagnosis_figure
    from dbbstation.report.figure_format import figure_format

    return diagnosis_figure(diagnosis, gains_by_test(diagnosis), source_curves(diagnosis), figure_format(wanted))
