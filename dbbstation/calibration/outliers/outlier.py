"""Outliers among the runs of a session, and their names."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.model.observation import Observation

    Fit = Callable[[Sequence[Observation]], Calibration]
    Step = tuple["Outlier", list[Observation], Calibration]

STANDS_OUT = 4.0
"""A run is an outlier whose residual is this many times the usual one ..."""

LEAST_UM = 3.0
"""... and more than a bar's noise could [µm]."""


class OutlierKind(StrEnum):
    """Kinds of outliers."""

    RUN = "run"
    WRONG_PLACE = "wrong-place"
    MOVED = "moved"
    MOUNTING = "mounting"
    BALL = "ball"
    BAR = "bar"


SOURCE_OF = {
    OutlierKind.MOUNTING: "mounting",
    OutlierKind.MOVED: "mounting",
    OutlierKind.BALL: "ball-coordinate",
    OutlierKind.WRONG_PLACE: "ball-coordinate",
    OutlierKind.BAR: "bar-offset",
}
"""Name of the error source that is out of size; a run that is no circle of this machine is none."""


@dataclass(frozen=True)
class Outlier:
    """One outlier.

    Attributes:
        kind: what it is.
        test: name of the test; of the session for a bar.
        run: label of the run, or of the runs of one putting-up.
        size_um: how far off: rms of a run, distance of a ball from its place, error of a bar's length [µm].
        shift_um: where a ball stands, machine axes; None for a run [µm].
        text: what it looks like, in words.
        sure: False where a badly seated ball cannot be told from a wrong CMM row: it was put up once only.
        uncertainty_um: standard uncertainty of the size; None for a run [µm].
        alike: error sources that would explain the recordings about as well in its place.
        freed: names of the mountings that may stand anywhere, or of the session whose bar may have any length.
        why: end of the text, what it may come from.
    """

    kind: OutlierKind
    test: str
    run: str
    size_um: float
    shift_um: tuple[float, float, float] | None
    text: str
    sure: bool = True
    uncertainty_um: float | None = None
    alike: tuple[str, ...] = ()
    freed: tuple[str, ...] = ()
    why: str = ""
