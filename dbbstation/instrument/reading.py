"""What an instrument says of one sample, whatever its wire looks like."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

SaidStatus: TypeAlias = Literal["ok", "overrange", "fault"]
"""What a device says of a length. `ok`: it can be trusted. `overrange`: it (or its range) says that it cannot. `fault`: no length."""

Status: TypeAlias = Literal["ok", "doubtful", "overrange", "fault"]
"""`doubtful`: the device says nothing against the length, but it may have been damaged on the line. It is kept and not used."""

OK: Status = "ok"
DOUBTFUL: Status = "doubtful"

SEVERITY: dict[Status, int] = {"ok": 0, "doubtful": 1, "overrange": 2, "fault": 3}
"""Where several parts of a reply speak of the status, the worst is taken."""


@dataclass(frozen=True, slots=True)
class Reading:
    """One sample.

    Attributes:
        t_s: host time of the sample, monotonic, in s; 0 where there is no clock (a codec alone).
        length_mm: length in mm; None exactly when the device gave no number (`status` is then not `ok`).
        lost: samples lost immediately before this one (gap of the counter, or replies that could not be read).
        counter: the device's own sample counter, None where its wire has none.
        said: what the device said where `status` is not `ok`; why it is doubted where it is `doubtful`.
        t_uncertainty_s: standard uncertainty of `t_s` where the request bounds it [s]; None of a stream, whose clock does better
            than its bounds.
        first_byte_s: host time at which the first byte had arrived at the latest, by the clock of `t_s` [s]; 0 without.
    """

    t_s: float
    length_mm: float | None
    status: Status = "ok"
    lost: int = 0
    counter: int | None = None
    said: str = ""
    remedy: str = ""
    t_uncertainty_s: float | None = None
    first_byte_s: float = 0.0

    @property
    def gone(self) -> bool:
        """Whether the device itself says that there is no length to be trusted; a doubtful one is lost on the line only."""
        return self.status not in {OK, DOUBTFUL}
