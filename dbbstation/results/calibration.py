"""The result of `calibrate`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from dbbstation.calibration.reporting.figures import CalibrationFigures, Covariance
from dbbstation.facts.serialise import AsItIs, Kept
from dbbstation.facts.value import Value, finite
from dbbstation.files.formats.model import write_model
from dbbstation.files.provenance import Provenance
from dbbstation.model.identified import IdentifiedModel
from dbbstation.results.evaluation import rows_of
from dbbstation.results.frame import Framed


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

    @property
    def parameters(self) -> dict[str, Value]:
        """Return the machine's parameters as `source.parameter`, with standard uncertainties."""
        return {f"{one.name}.{name}": value for one in self.sources for name, value in one.parameters.items()}

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
