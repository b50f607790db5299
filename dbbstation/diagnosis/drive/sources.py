"""Laws as causes of force in a drive: by name, and over the columns of a recording."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from dbbstation import laws
from dbbstation.catalogue import InFolders, looked_up
from dbbstation.errors import ModelError
from dbbstation.laws.contract import MOVING, TableSource

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.drive.signals import Signals
    from dbbstation.laws.contract import SourceForm

COLUMNS: Mapping[str, Callable[[Signals], Floats]] = {
    "t_s": lambda s: s.t_s,
    "position_mm": lambda s: 1e3 * s.position_m,
    "speed_mm_s": lambda s: 1e3 * s.speed_m_s,
    "acceleration_mm_s2": lambda s: 1e3 * s.acceleration_m_s2,
    "direction": lambda s: s.direction,
    "since_reversal_mm": lambda s: 1e3 * s.since_reversal_m,
    # The low-pass bounds the noise of the difference.
    "force_rate_n_s": lambda s: np.gradient(s.force_n, 1.0 / s.rate_hz),
}
"""Columns of a recording, shape (n,): those of `MOVING`, and the force's rate."""


@cache
def known_drive_sources() -> Mapping[str, TableSource]:
    """Return all causes, sorted by name."""
    return InFolders(TableSource, laws)  # type: ignore[type-abstract] # subclasses are instantiated


def drive_sources_named(names: Iterable[str]) -> tuple[TableSource, ...]:
    """Return causes by name.

    Raises:
        ModelError: an unknown name.
    """
    known = known_drive_sources()
    return tuple(looked_up(name, known, called="cause of force in a drive", error=ModelError) for name in names)


def variable_of(source: TableSource) -> str:
    """Return the variable on which a force depends, as printed."""
    return source.varies_with or MOVING[source.follows or source.needs[0]]


def force(source: TableSource, form: SourceForm, shapes: tuple[float, ...] = ()) -> Callable[[Signals], Floats]:
    """Return the function from a recording to forces per amplitude, shape (n, p) [N], for nonlinear parameters."""
    return lambda signals: form.at({name: COLUMNS[name](signals) for name in source.needs}, shapes)
