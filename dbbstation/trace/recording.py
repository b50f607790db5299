"""A run as recorded."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from dbbstation.trace.columns import WithLogged, each

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.trace.columns import Logged


@dataclass(frozen=True, eq=False)
class Recording(WithLogged):
    """Samples of one run in time order, shapes (n,).

    Attributes:
        t_s: host time since the first sample, strictly rising.
        length_mm: between ball centres, raw.
        theta_deg: commanded, from +X towards +Y, of a cut recording; None if the circle must be found in the trace.
        usable: False for bad and doubtful samples, which stay.
    """

    name: str
    t_s: Floats
    length_mm: Floats
    theta_deg: Floats | None = None
    logged: Logged = field(default_factory=dict)
    usable: Flags | None = None

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def good(self) -> Recording:
        """Return the usable samples, for all calculations."""
        # A recording that equals its good part is not cached: a reference to itself would delay freeing its memory.
        return self if self.usable is None or self.usable.all() else self._usable_rows

    @cached_property
    def _usable_rows(self) -> Recording:
        rows = self.usable
        return Recording(
            name=self.name,
            t_s=self.t_s[rows],
            length_mm=self.length_mm[rows],
            theta_deg=None if self.theta_deg is None else self.theta_deg[rows],
            logged=each(self.logged, lambda values: values[rows]),
        )


@dataclass(frozen=True, eq=False)
class DriveRecording:
    """Samples of one drive, in time order.

    Attributes:
        position_mm: along the axis, shape (n,).
        force_n: driving, positive towards greater positions, shape (n,).
    """

    name: str
    t_s: Floats
    position_mm: Floats
    force_n: Floats

    def __len__(self) -> int:
        return len(self.t_s)
