"""What a calibration found: the result of `calibrate`."""

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
        method: how ball positions are known: `jig`, `conv-a` or `conv-b`.
        covariance: of the machine's parameters.
        model: to predict and compensate with, or to write to a file.
    """

    method: str
    covariance: Covariance
    model: Annotated[IdentifiedModel, AsItIs, Kept] = field(repr=False)

    def rows(self) -> list[dict[str, object]]:
        """The machine's parameters, one row for each; `u` is the standard uncertainty."""
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
        """Figures of the runs before and after, one row for each."""
        return rows_of(self.runs)
