"""A machine model with the uncertainty and origin of its parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.facts.value import finite

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.computing.arrays import Floats
    from dbbstation.model.machine_model import MachineModel

Row = tuple[str, str, str]
"""Source, sharing set and parameter of a row of the covariance."""


@dataclass(frozen=True, eq=False)
class IdentifiedModel:
    """The outcome of a calibration or diagnosis.

    Attributes:
        model: nominal machine with error sources of the machine and of the measurement.
        covariance_rows: (source, set, parameter) of every row.
        covariance: in products of units, shape (k, k), with formula errors; zero in directions held at nominal.
        directions_lost: descriptions of directions that the recordings do not determine.
        sessions: SHA-256 of its session files, by folder.
        null_space: undetermined combinations of rows, scaled to prior standard deviations, shape (h, k); None in old files.
        formula_variance: part of each row's variance due to its formula, equal in all sessions, shape (k,); None if zero.
    """

    model: MachineModel
    covariance_rows: tuple[Row, ...]
    covariance: Floats
    directions_lost: tuple[str, ...] = ()
    report: Mapping[str, Any] = field(default_factory=dict)
    sessions: Mapping[str, str] = field(default_factory=dict)
    null_space: Floats | None = None
    formula_variance: Floats | None = None

    @property
    def unseen(self) -> Floats | None:
        """Return the null space, shape (h, k); None if unknown."""
        if self.null_space is None and not self.directions_lost:
            return np.zeros((0, len(self.covariance_rows)))
        return self.null_space

    @property
    def uncertainties(self) -> dict[Row, float | None]:
        """Return each parameter's standard uncertainty; None if unknown.

        Prescribed parameters define the coordinates, so all parameters are known.
        """
        variance = np.maximum(np.diag(self.covariance), 0.0)
        along = np.where(variance > 0.0, 0.0, np.inf if self.directions_lost else 0.0)
        if self.report.get("parameters_prescribed"):
            along = np.zeros(len(variance))
        elif (unseen := self.unseen) is not None:
            along = np.sum(unseen**2, axis=0)
        u = known_u(variance, along)
        return {row: finite(value) for row, value in zip(self.covariance_rows, u.tolist(), strict=True)}

    @property
    def uncertainties_between_sessions(self) -> dict[Row, float]:
        """Return the standard uncertainty of each parameter for comparing two sessions.

        Formula errors and held values are common to both sessions and do not count.
        """
        variance = np.diag(self.covariance) - (0.0 if self.formula_variance is None else self.formula_variance)
        return dict(zip(self.covariance_rows, np.sqrt(np.maximum(variance, 0.0)).tolist(), strict=True))

    @property
    def why_unknown(self) -> str:
        """Return why a value's uncertainty is unknown."""
        if not self.directions_lost:
            return "the model states no uncertainty of its parameters"
        lost = "; ".join(self.directions_lost)
        if self.null_space is None:
            return f"an older program wrote the model, which does not say what this changes: {lost}"
        return f"the recordings do not determine: {lost}"


def known_u(variance: Floats, along: Floats) -> Floats:
    """Return standard uncertainties; NaN if the prior mostly determines them."""
    return np.sqrt(np.where(along > variance, np.nan, variance + along))
