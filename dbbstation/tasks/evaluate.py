"""Evaluate: compute the residual of recordings under a model, circle by circle."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from typing import TYPE_CHECKING

from dbbstation.tasks import options as o
from dbbstation.tasks.declare import task
from dbbstation.tasks.telling import Telling

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Unpack

    from dbbstation.plan.tolerance import Tolerance
    from dbbstation.results.calibration import EvaluationResult
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.telling import Hooks

STAGES = {"predicting runs": 0}
"""Stages of an evaluation after reading, and the share of its time that has passed at each begin [%]."""


@task("evaluate", label="evaluation", stages=STAGES)
def evaluate(
    sessions: o.RecordedSessions,
    model: o.Model,
    *,
    source_files: o.SourceFiles = (),
    tests: o.Tests = (),
    exclude: o.Exclude = (),
    tolerances: Sequence[Tolerance] = (),
    known: Mapping[str, ErrorSource] | None = None,
    **hooks: Unpack[Hooks],
) -> EvaluationResult:
    r"""Compare recordings with the nominal machine (before) and with a model (after), which must be of the same machine.

    \"After\" is the residual of the model, not a new measurement. The second table shows the measured and the predicted
    circular deviation G. In both tables G is computed from readings low-passed at 30 undulations per revolution. For
    uncompensated programs the model also predicts flatness over X, Y = ±190 mm and parallelism of a move along X. Every
    circle is compared with the tolerances of the shop's settings.

    \b
    Examples:
      dbbstation evaluate check-session --model model.yaml
      dbbstation evaluate check-session --model model.yaml --json

    Args:
        tolerances: for every circle.
        known: error sources by name, for a file; None: those of package, installed packages and `source_files`.
        stop: asked after each run.

    Raises:
        ArgumentError: a value that it does not take.
        InputError: faults of files and traces.
        TraceError: a run that is no circle.
        ModelError: the model is of another machine; a source needs unknown data.
        KinematicsError: the plane of flatness lies outside the workspace.
        StoppedError: `stop` returned True.
    """
    from dbbstation.calibration.reporting import evaluation
    from dbbstation.calibration.reporting.prediction import predicted_circles
    from dbbstation.facts import of_facts
    from dbbstation.machine.geometry import check_model_is_of
    from dbbstation.results.calibration import EvaluationResult
    from dbbstation.results.model_warnings import model_warnings
    from dbbstation.tasks.load import loaded
    from dbbstation.tasks.models import model_of, sources_known

    telling = Telling(**hooks)
    identified = model_of(model, sources_known(known, source_files))
    telling.note(*model_warnings(identified))
    recorded = loaded(sessions, tests, exclude, telling)
    check_model_is_of(recorded.machine, identified.model.machine)
    found = evaluation.evaluate(identified.model, recorded.observations)
    circles = predicted_circles(identified.model, recorded.observations, telling.counted("predicting runs"))
    runs = tuple(replace(run, circularity_30_upr_um=circle) for run, circle in zip(found.runs, circles, strict=True))
    height_mm = min(observation.raw.circle.centre_mm[2] for observation in recorded.observations)
    plane = evaluation.plane_figures(identified.model, height_mm)
    flatness_u_um, parallelism_u_um = evaluation.plane_uncertainty_um(identified, height_mm)
    own, placed = identified.model.of_the_machine().sources, identified.model.anywhere().sources
    return of_facts(
        EvaluationResult,
        found,
        plane,
        runs=runs,
        held_out=set(chain(*recorded.sessions.items())).isdisjoint(chain(*identified.sessions.items())),
        flatness_u_um=flatness_u_um,
        parallelism_u_um=parallelism_u_um,
        plane_uncertainty_not_known_because=identified.why_unknown
        if None in (flatness_u_um, parallelism_u_um)
        else None,
        plane_z_mm=height_mm,
        plane_without=tuple(f.source.name for f in own if f not in placed and not f.source.of_currents),
        tolerances=evaluation.evaluated_tolerances(tolerances, runs),
        notes=tuple(telling.notes),
    )
