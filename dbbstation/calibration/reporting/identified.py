"""Make the model that is stored after a calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.model.identified import IdentifiedModel
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Owner

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.calibration.fit.calibrate import Calibration


def identified_model(
    calibration: Calibration, report: Mapping[str, Any], sessions: Mapping[str, str]
) -> IdentifiedModel:
    """Return the model to store, with the covariance of machine parameters and the origin of the data."""
    machines = [term for term in calibration.layout.terms if term.source.belongs_to is Owner.MACHINE]
    rows = np.concatenate([np.r_[term.columns] for term in machines])
    names = calibration.layout.names
    of_formulas = calibration.layout.formula_variance(calibration.x)[rows]
    covariance = calibration.solution.covariance[np.ix_(rows, rows)] + np.diag(of_formulas)
    return IdentifiedModel(
        model=MachineModel(calibration.layout.machine, calibration.model.sources),
        covariance_rows=tuple(names[row] for row in rows),
        covariance=(covariance + covariance.T) / 2.0,
        directions_lost=calibration.directions_lost,
        report=report,
        sessions=sessions,
        null_space=calibration.null_space[:, rows],
        formula_variance=of_formulas,
    )
