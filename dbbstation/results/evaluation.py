"""The result of `evaluate`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from dbbstation.calibration.reporting.evaluation import EvaluatedRun, EvaluatedTolerance
from dbbstation.facts.serialise import Absent
from dbbstation.results.frame import Framed


@dataclass(frozen=True, kw_only=True)
class EvaluationResult(Framed):
    """Residuals of a model, and the uncompensated machine's accuracy.

    Attributes:
        nominal_rms_um: rms of measured less nominally predicted lengths over all runs.
        flatness_um: flatness of X, Y = ±190 mm without compensation, by the model.
        parallelism_um: of a move along X without compensation.
        held_out: whether the model's fit used none of the sessions, by name and hash.
        plane_without: sources left out of both, since they need more than a pose.
        tolerances: None if another result holds them.
    """

    runs: tuple[EvaluatedRun, ...]
    nominal_rms_um: float
    residual_rms_um: float
    held_out: bool
    flatness_um: float
    flatness_u_um: float | None
    parallelism_um: float
    parallelism_u_um: float | None
    plane_uncertainty_not_known_because: str | None
    plane_z_mm: float
    plane_without: tuple[str, ...]
    tolerances: Annotated[tuple[EvaluatedTolerance, ...] | None, Absent] = ()

    def rows(self) -> list[dict[str, object]]:
        """Return one row per run."""
        return rows_of(self.runs)


def rows_of(runs: tuple[EvaluatedRun, ...]) -> list[dict[str, object]]:
    """Return figures of runs as rows; lengths in µm."""
    rows = []
    for run in runs:
        row: dict[str, object] = {"test": run.test, "direction": run.direction, "repeat": run.repeat}
        for when, of in (("measured", run.measured), ("before", run.before), ("after", run.after)):
            row[f"{when}_centre_deviation_um"] = of.centre_deviation_um
            row[f"{when}_mean_radial_error_um"] = of.mean_radial_error_um
            row[f"{when}_circularity_um"] = of.circularity_um
        rows.append(row)
    return rows
