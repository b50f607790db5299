"""An identified model: a machine model with the uncertainty and the provenance of its numbers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from dbbstation.model.machine_model import MachineModel


@dataclass(frozen=True, eq=False)
class IdentifiedModel:
    """What a calibration or diagnosis found.

    Attributes:
        model: nominal machine, its own sources and, separate by their owner, the measurement's.
        covariance_rows: name of every row of the covariance as (source, set, parameter).
        covariance: of those parameters, in the products of their units, shape (k, k). A direction that was
            held at nominal has zero variance here and stands in `directions_lost`.
        directions_lost: what the recordings could not see, in words.
        report: numbers of the fit as printed, by name.
        sessions: SHA-256 of each session file that it comes from, by folder name.
    """

    model: MachineModel
    covariance_rows: tuple[tuple[str, str, str], ...]
    covariance: NDArray[np.float64]
    directions_lost: tuple[str, ...] = ()
    report: Mapping[str, Any] = field(default_factory=dict)
    sessions: Mapping[str, str] = field(default_factory=dict)
