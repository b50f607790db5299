"""The results of `calibrate` and `evaluate`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from dbbstation.calibration.reporting.evaluation import EvaluatedRun, EvaluatedTolerance
from dbbstation.calibration.reporting.figures import CalibrationFigures, Covariance
from dbbstation.facts import picked
from dbbstation.facts.serialise import Absent, AsItIs, Kept
from dbbstation.facts.value import finite
from dbbstation.files.formats.model import write_model
from dbbstation.files.provenance import Provenance
from dbbstation.model.identified import IdentifiedModel
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
    sizes = ("centre_deviation_um", "mean_radial_error_um", "circularity_um")
    each = [(when, name) for when in ("measured", "before", "after") for name in sizes]
    return [
        picked(run, "test", "direction", "repeat")
        | {f"{when}_{name}": getattr(getattr(run, when), name) for when, name in each}
        for run in runs
    ]


@dataclass(frozen=True, kw_only=True, eq=False)
class WithModel(Framed):
    """A result with a model for prediction or compensation, which `save` writes, and the sessions it was fitted to."""

    model: Annotated[IdentifiedModel, AsItIs, Kept] = field(repr=False)
    recorded: Annotated[Any, AsItIs, Kept] = field(default=None, repr=False)

    def _save(self, path: Path, provenance: Provenance, *, force: bool) -> None:
        write_model(path, self.model, provenance=provenance, force=force)


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibrationResult(WithModel, CalibrationFigures):
    """Result of a calibration.

    Attributes:
        centre_u_um: greatest u of the tool's X, Y and Z at the circles' centres; None if unknown.
        method: knowledge of ball positions: `jig`, `conv-a` or `conv-b`.
    """

    method: str
    centre_u_um: tuple[float | None, float | None, float | None]
    covariance: Covariance

    def headline(self) -> str:
        """Return the number of parameters and the residual."""
        left = f"leaves {self.residual_rms_um:.2f} of {self.nominal_rms_um:.2f} µm rms"
        return f"{self.parameters_identified} parameters, {left}"

    def rows(self) -> list[dict[str, object]]:
        """Return the machine's parameters as rows; `u` is the standard uncertainty."""
        return [
            {
                "source": one.name,
                "parameter": name,
                "value": each.value,
                "u": finite(each.uncertainty),
                "unit": each.unit,
            }
            for one in self.sources
            for name, each in one.parameters.items()
        ]

    def run_rows(self) -> list[dict[str, object]]:
        """Return figures of runs before and after as rows."""
        return rows_of(self.runs)
