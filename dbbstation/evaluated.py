"""From recorded sessions and a model to what the model leaves of them, circle by circle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dbbstation.calibration.reporting.evaluation import evaluate, plane_figures, plane_uncertainty_um
from dbbstation.calibration.reporting.prediction import predicted_circles
from dbbstation.calibration.reporting.summary import evaluation_summary

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.recorded import Recorded


def evaluated(
    identified: IdentifiedModel,
    recorded: Recorded,
    progress: Callable[[int, int], None] = lambda _done, _of: None,
) -> dict[str, Any]:
    """Return the figures of every run before and after, G up to 30 undulations, flatness and parallelism, as plain numbers.

    Args:
        identified: the model, of the machine that was recorded.
        recorded: the runs.
        progress: told how many of how many runs are predicted.

    Raises:
        TraceError: a run that is no circle.
        ModelError: a source needs what the runs do not give.
        KinematicsError: the plane of flatness lies outside the workspace.
    """
    summary = evaluation_summary(evaluate(identified.model, recorded.observations))
    circles = predicted_circles(identified.model, recorded.observations, progress)
    for run, circle in zip(summary["runs"], circles, strict=True):
        run["circularity_30_upr_um"] = {
            "measured": circle.measured_um,
            "predicted": circle.predicted_um,
            "before": circle.before_um,
            "after": circle.after_um,
        }
    height_mm = min(observation.raw.circle.centre_mm[2] for observation in recorded.observations)
    plane = plane_figures(identified.model, height_mm)
    flatness_u_um, parallelism_u_um = plane_uncertainty_um(identified, height_mm)
    own, placed = identified.model.of_the_machine().sources, identified.model.anywhere().sources
    return summary | {
        "flatness_um": plane.flatness_um,
        "flatness_u_um": flatness_u_um,
        "parallelism_um": plane.parallelism_um,
        "parallelism_u_um": parallelism_u_um,
        "plane_uncertainty_not_known_because": None
        if None not in {flatness_u_um, parallelism_u_um}
        else identified.why_unknown,
        "plane_z_mm": height_mm,
        "plane_without": [f.source.name for f in own if f not in placed and not f.source.of_currents],
    }
