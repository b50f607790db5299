"""A user's table source as a cause of force."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.contract import DriveForm, DriveSource, Scale
from dbbstation.laws.contract import MOVING

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.drive.signals import Signals
    from dbbstation.laws.contract import TableSource


def drive_columns(signals: Signals) -> dict[str, Floats]:
    """Return the columns of `MOVING`, shape (n,) each, for all samples of a recording."""
    return {
        "t_s": signals.t_s,
        "position_mm": 1e3 * signals.position_m,
        "speed_mm_s": 1e3 * signals.speed_m_s,
        "acceleration_mm_s2": 1e3 * signals.acceleration_m_s2,
        "direction": signals.direction,
        "since_reversal_mm": 1e3 * signals.since_reversal_m,
    }


def own_force(source: TableSource) -> DriveSource:
    """Return a cause of force [N] from a source that uses columns of `MOVING`."""
    shapes = [p.name for p in source.parameters() if p.grid]

    def columns(signals: Signals, values: tuple[float, ...]) -> Floats:
        known = drive_columns(signals)
        given = {name: known[name] for name in source.needs}
        return np.asarray(source.columns(given, dict(zip(shapes, values, strict=True))), dtype=np.float64)

    class OwnForce(DriveSource):
        """The source as a cause of force."""

        name = source.name
        varies_with = MOVING[source.follows or source.needs[0]]
        texts = source.texts
        form_uncertainty = source.form_uncertainty

        def forms(self, scale: Scale) -> tuple[DriveForm, ...]:  # noqa: ARG002 - the source states sizes itself
            return (DriveForm(source.parameters(), columns),)

    return OwnForce()
