"""The result of `predict`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from dbbstation.computing.arrays import Floats
from dbbstation.facts.serialise import Absent, AsItIs, Kept
from dbbstation.facts.value import finite
from dbbstation.files.provenance import Provenance
from dbbstation.files.recordings.pose_csv import POSE_COLUMNS, PoseTable, write_poses
from dbbstation.model.identified import pose_errors
from dbbstation.results.frame import Framed
from dbbstation.results.model_warnings import model_warnings, unknown_causes

if TYPE_CHECKING:
    from dbbstation.model.identified import IdentifiedModel


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictionResult(Framed):
    """Actual poses for commanded ones.

    Attributes:
        common_shift_um: mean error of X, Y and Z, which a zero set on the part removes.
        error_about_mean_rms_um: rms error without the common shift.
        greatest_uncertainty_um: greatest standard uncertainty of a position; None if unknown.
        greatest_uncertainty_by_axis_um: the same for each of X, Y and Z.
        uncertainty_mm: standard uncertainty of X, Y and Z, shape (n, 3); NaN if unknown.
    """

    file: Annotated[str | None, Absent] = None
    poses: int
    greatest_error_um: float
    error_rms_um: float
    common_shift_um: tuple[float, ...]
    error_about_mean_rms_um: float
    greatest_uncertainty_um: float | None
    greatest_uncertainty_by_axis_um: Mapping[str, float | None]
    uncertainty_not_known_because: str | None
    directions_lost: tuple[str, ...]
    unknown_causes: tuple[str, ...]
    model_warnings: tuple[str, ...]
    commanded: Annotated[Floats, AsItIs, Kept] = field(repr=False)
    actual: Annotated[Floats, AsItIs, Kept] = field(repr=False)
    uncertainty_mm: Annotated[Floats, AsItIs, Kept] = field(repr=False)
    others: Annotated[Mapping[str, Sequence[str]], AsItIs, Kept] = field(default_factory=dict, repr=False)

    def _save(self, path: Path, provenance: Provenance, *, force: bool) -> None:
        write_poses(
            path,
            self.actual,
            self.uncertainty_mm,
            self.others,
            provenance,
            why_unknown=self.uncertainty_not_known_because or "",
            warning="; ".join(self.model_warnings),
            force=force,
        )

    def headline(self) -> str:
        """Return the number of poses and their errors."""
        return f"{self.poses} poses, position errors {self.error_rms_um:.2f} µm rms, {self.greatest_error_um:.2f} µm at most"

    def rows(self) -> list[dict[str, object]]:
        """Return actual poses with standard uncertainties, a row each."""
        return [
            dict(zip(POSE_COLUMNS, pose, strict=True))
            | {f"u_{axis}_mm": finite(u) for axis, u in zip("xyz", known, strict=True)}
            for pose, known in zip(self.actual.tolist(), self.uncertainty_mm.tolist(), strict=True)
        ]


def prediction_result(
    identified: IdentifiedModel, table: PoseTable, actual: Floats, uncertainty_mm: Floats
) -> PredictionResult:
    """Return the result of a prediction."""
    figures = pose_errors(table.poses, actual, uncertainty_mm)
    unknown = None in figures.greatest_uncertainty_by_axis_um.values()
    return PredictionResult(
        poses=len(actual),
        **vars(figures),
        uncertainty_not_known_because=identified.why_unknown if unknown else None,
        directions_lost=tuple(identified.directions_lost),
        unknown_causes=unknown_causes(identified.model),
        model_warnings=model_warnings(identified),
        commanded=table.poses,
        actual=actual,
        uncertainty_mm=uncertainty_mm,
        others=table.others,
    )
