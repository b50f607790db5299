"""The result of `calibrate`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from dbbstation.calibration.reporting.figures import CalibrationFigures, Covariance
from dbbstation.facts.serialise import AsItIs, Kept
from dbbstation.facts.value import finite
from dbbstation.model.identified import IdentifiedModel
from dbbstation.results.evaluation import rows_of
from dbbstation.results.frame import Framed


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibrationResult(Framed, CalibrationFigures):
    """What a calibration found.

    Attributes:
        method: of ball positions: `jig`, `conv-a` or `conv-b`.
        covariance: of the machine's parameters.
        model: for prediction, compensation or a file.
    """

    method: str
    covariance: Covariance
    model: Annotated[IdentifiedModel, AsItIs, Kept] = field(repr=False)

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
