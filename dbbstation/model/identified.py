"""An identified model: a machine model with the uncertainty and the provenance of its numbers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from dbbstation.model.machine_model import MachineModel

Row = tuple[str, str, str]
"""Source, set and parameter of a row of the covariance."""


@dataclass(frozen=True, eq=False)
class IdentifiedModel:
    """What a calibration or diagnosis found.

    Attributes:
        model: nominal machine, its own sources and, separate by their owner, the measurement's.
        covariance_rows: name of every row of the covariance as (source, set, parameter).
        covariance: of those parameters, in the products of their units, shape (k, k), what formulas may be off by among it. A
            direction that was held at nominal has zero variance here.
        directions_lost: what the recordings could not determine, in words.
        report: numbers of the fit as printed, by name.
        sessions: SHA-256 of each session file that it comes from, by folder name.
        null_space: combinations of the rows that the recordings could not determine, each at its plausible size in the
            parameters' units, shape (h, k); None where the file of an older program does not say.
        formula_variance: part of each row's variance that is what the formula of its source may be off by, the same in every
            session of a machine, shape (k,); None for none.
    """

    model: MachineModel
    covariance_rows: tuple[Row, ...]
    covariance: NDArray[np.float64]
    directions_lost: tuple[str, ...] = ()
    report: Mapping[str, Any] = field(default_factory=dict)
    sessions: Mapping[str, str] = field(default_factory=dict)
    null_space: NDArray[np.float64] | None = None
    formula_variance: NDArray[np.float64] | None = None

    @property
    def unseen(self) -> NDArray[np.float64] | None:
        """The null space, shape (h, k), without a row where nothing was lost; None where it is not known."""
        if self.null_space is None and not self.directions_lost:
            return np.zeros((0, len(self.covariance_rows)))
        return self.null_space

    @property
    def uncertainties(self) -> dict[Row, float | None]:
        """Standard uncertainty of each parameter of the covariance; None where it is not known.

        Where parameters were prescribed in place of what was lost, they define coordinates: all are known in these.
        """
        variance = np.maximum(np.diag(self.covariance), 0.0)
        along = np.where(variance > 0.0, 0.0, np.inf if self.directions_lost else 0.0)
        if self.report.get("parameters_prescribed"):
            along = np.zeros(len(variance))
        elif (unseen := self.unseen) is not None:
            along = np.sum(unseen**2, axis=0)
        u = known_u(variance, along)
        return {row: _or_none(value) for row, value in zip(self.covariance_rows, u, strict=True)}

    @property
    def uncertainties_between_sessions(self) -> dict[Row, float]:
        """Standard uncertainty of each parameter for its change from one session of a machine to another.

        What a formula may be off by is the same in both, and so is what was held at nominal.
        """
        variance = np.diag(self.covariance) - (0.0 if self.formula_variance is None else self.formula_variance)
        return dict(zip(self.covariance_rows, np.sqrt(np.maximum(variance, 0.0)).tolist(), strict=True))

    @property
    def why_unknown(self) -> str:
        """Why the uncertainty of a value is not known, where it is not."""
        if not self.directions_lost:
            return "the model states no uncertainty of its parameters"
        lost = "; ".join(self.directions_lost)
        if self.null_space is None:
            return f"an older program wrote the model, which does not say what this changes: {lost}"
        return f"the recordings do not determine: {lost}"


def known_u(variance: NDArray[np.float64], along: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard uncertainties; NaN where they would rest on a guess for their greater part.

    Args:
        along: variance along what the recordings cannot determine, each combination at its plausible size. The smaller part is
            part of the uncertainty; the greater part is no measurement.
    """
    return np.sqrt(np.where(along > variance, np.nan, variance + along))


def _or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
