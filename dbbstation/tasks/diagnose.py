"""Diagnose: from recorded sessions to physics beyond a kinematic calibration."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit.calibrate import default_sources
from dbbstation.calibration.reporting.evaluation import evaluate
from dbbstation.calibration.reporting.figures import calibration_figures, report_of
from dbbstation.calibration.reporting.identified import identified_model
from dbbstation.diagnosis import diagnose as search
from dbbstation.diagnosis.diagnose import usable_sources
from dbbstation.diagnosis.effects import effects_of
from dbbstation.diagnosis.unexplained_model import keep_unexplained as keeping
from dbbstation.errors import ModelError
from dbbstation.facts.serialise import plain
from dbbstation.files.own_sources import every_source
from dbbstation.results.effects import effect_results
from dbbstation.results.of_diagnosis import diagnosis_figures, diagnosis_result, kept_of
from dbbstation.sources.registry import known_sources, sources_named
from dbbstation.tasks.load import loaded
from dbbstation.tasks.telling import Telling, never, silent

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from dbbstation.diagnosis.findings import Diagnosis
    from dbbstation.diagnosis.unexplained_model import JointFitWithCurve
    from dbbstation.results.diagnosis import DiagnosisResult
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.load import Recorded, Sessions
    from dbbstation.tasks.telling import Progress

STAGES = {
    "kinematic calibration": 0,
    "candidates": 10,
    "joint fit": 45,
    "verdicts": 75,
    "held-out tests": 77,
    "next test": 80,
    "effects of causes": 95,
}
"""Stages of a diagnosis once runs are read, and the share of its time that has passed by then [%]; joint fits are none or several."""


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """Recorded sessions with their diagnosis.

    Attributes:
        lacking: reasons against further candidates, by name.
    """

    recorded: Recorded
    diagnosis: Diagnosis
    lacking: Mapping[str, str]

    def summary(self) -> dict[str, object]:
        """Return all results as plain numbers."""
        return plain(diagnosis_figures(self.diagnosis, self.lacking))


def default_candidates(known: Mapping[str, ErrorSource]) -> list[str]:
    """Return the error sources that are not always fitted."""
    fitted = {source.name for source in default_sources()}
    return [name for name, source in known.items() if name not in fitted and source.candidate]


def diagnose_sessions(
    paths: Sequence[Path],
    candidates: Sequence[str] | None,
    exclude: Sequence[str],
    say: Callable[[str], None],
    known: Mapping[str, ErrorSource] | None = None,
    progress: Callable[[str], None] = lambda _: None,
    reading: Callable[[int, int], None] = lambda _done, _of: None,
    only: Sequence[str] = (),
) -> Diagnosed:
    """Read sessions of one machine and find physics beyond a kinematic calibration.

    Args:
        paths: folders or session files.
        candidates: source names; None: all.
        known: sources by name; None: the package's.
        only: names of tests; empty for all.

    Raises:
        InputError: faults of files and traces.
        ModelError: an unknown source, or one that is no cause.
        CalibrationError: the kinematic model cannot be fitted.
    """
    telling = Telling(_staged(progress, reading), say=lambda text: say(f"note: {text}"))
    return _diagnosed(paths, candidates, (tuple(only), tuple(exclude)), known or known_sources(), telling)


def _staged(progress: Callable[[str], None], reading: Callable[[int, int], None]) -> Progress:
    def tell(text: str, done: int = 0, of: int = 0) -> None:
        if of:
            reading(done, of)
        else:
            progress(text)

    return tell


def diagnose(
    sessions: Sessions | Recorded,
    *,
    sources: Sequence[str] | None = None,
    tests: Sequence[str] = (),
    exclude: Sequence[str] = (),
    keep_unexplained: bool = False,
    hold_out: bool = True,
    until_interrupted: bool = False,
    known: Mapping[str, ErrorSource] | None = None,
    progress: Progress = silent,
    stop: Callable[[], bool] = never,
    say: Callable[[str], None] = silent,
) -> DiagnosisResult:
    """Find, name and model the physics that a kinematic calibration leaves out.

    Args:
        sessions: folders, or the result of `load`.
        sources: names; None: all.
        tests: names; empty for all.
        exclude: names of tests.
        hold_out: choose anew without each group of tests, to check predictions.
        until_interrupted: a KeyboardInterrupt ends the comparison with the best set so far.
        keep_unexplained: keep an unmodelled effect as a compensated curve.
        known: error sources by name; None: those of package and installed packages.
        progress: called with each stage.
        stop: asked at each stage.
        say: called with notes.

    Returns:
        Causes with their verdicts, and the joint model; `drawing` draws them.

    Raises:
        InputError: faults of files and traces.
        ModelError: an unknown source, or one that is no cause.
        CalibrationError: the kinematic model cannot be fitted.
        StoppedError: `stop` returned True.
    """
    telling = Telling(progress, stop, say)
    every = every_source() if known is None else known
    how = partial(search.diagnose, hold_out=hold_out, until_interrupted=until_interrupted)
    diagnosed = _diagnosed(sessions, sources, (tuple(tests), tuple(exclude)), every, telling, how)
    found = diagnosed.diagnosis
    unnamed = _kept(found, telling) if keep_unexplained else None
    fit = found.after if unnamed is None else unnamed.fit
    figures = diagnosis_figures(found, diagnosed.lacking)
    report = report_of(calibration_figures(fit, evaluate(fit.model, fit.observations)), diagnosis=kept_of(figures))
    of_sessions = diagnosed.recorded.sessions
    model = identified_model(fit, report, of_sessions) if unnamed is None else unnamed.identified(report, of_sessions)
    telling.stage("effects of causes")
    names = fit.layout.names
    of_formulas = fit.layout.formula_variance(fit.x)
    covariance = fit.solution.covariance + np.diag(of_formulas)
    effects = effects_of(fit.model, fit.observations, names, covariance, fit.null_space, of_formulas)
    return diagnosis_result(
        figures,
        effects=effect_results(effects, {one.name: one.verdict for one in figures.sources}),
        model=model,
        drawing=partial(_drawn, found),
        notes=tuple(telling.notes),
    )


def _diagnosed(
    sessions: Sessions | Recorded,
    candidates: Sequence[str] | None,
    chosen: tuple[Sequence[str], Sequence[str]],
    known: Mapping[str, ErrorSource],
    telling: Telling,
    how: Callable[..., Diagnosis] = search.diagnose,
) -> Diagnosed:
    named = sources_named(default_candidates(known) if candidates is None else candidates, known)
    for source in named:
        if not source.candidate:
            what = f"{source.name} is no cause: it only keeps in a model what a diagnosis left without a name"
            raise ModelError(what, remedy="leave it out; --keep-unexplained keeps what is left")
    recorded = loaded(sessions, *chosen, telling)
    usable, lacking = usable_sources(recorded.machine, recorded.observations, named)
    found = how(recorded.machine, recorded.observations, usable, telling.stage)
    return Diagnosed(recorded, found, lacking)


def _kept(found: Diagnosis, telling: Telling) -> JointFitWithCurve | None:
    """Return the unmodelled effect to keep, or None with a note."""
    try:
        return keeping(found.unexplained.curve, found.after)
    except ModelError as error:
        telling.note(f"the model is written without it: {error.what}")
        return None


def _drawn(diagnosis: Diagnosis, wanted: object) -> bytes:
    from dbbstation.report.diagnosis_figure import diagnosis_figure  # noqa: PLC0415 - half a second for who draws nothing
    from dbbstation.report.figure_format import figure_format  # noqa: PLC0415

    return diagnosis_figure(diagnosis, figure_format(wanted))
