"""One sample of any instrument."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

SaidStatus: TypeAlias = Literal["ok", "overrange", "fault"]
"""A device's status of a length. `ok`: valid. `overrange`: invalid by the device or its range. `fault`: no length."""

Status: TypeAlias = Literal["ok", "doubtful", "overrange", "fault"]
"""`doubtful`: the device reports no fault, but the length may have been damaged on the line. It is kept, but not
used."""

OK: Status = "ok"
DOUBTFUL: Status = "doubtful"

SEVERITY: dict[Status, int] = {"ok": 0, "doubtful": 1, "overrange": 2, "fault": 3}
"""Order of severity. If several parts of a reply have a status, the worst applies."""


@dataclass(frozen=True, slots=True)
class Reading:
    """One sample.

    Attributes:
        t_s: monotonic host time; 0 without a clock.
        length_mm: None exactly if there is no number; `status` is then not `ok`.
        lost: samples lost just before, by counter or unreadable replies.
        counter: of the device, or None.
        said: the device's words, or the reason for doubt; if not `ok`.
        t_uncertainty_s: standard, bounded by the request; None for a stream.
    """

    t_s: float
    length_mm: float | None
    status: Status = "ok"
    lost: int = 0
    counter: int | None = None
    said: str = ""
    remedy: str = ""
    t_uncertainty_s: float | None = None

    @property
    def gone(self) -> bool:
        """Return whether the device reports no length; a doubtful length is still a length."""
        return self.status not in {OK, DOUBTFUL}
