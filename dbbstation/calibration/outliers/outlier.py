"""Outliers among the runs of a session, and their names."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

from dbbstation.facts.serialise import Kept

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


@dataclass(frozen=True, kw_only=True)
class Outlier:
    """One outlier, which was kept out of the fit.

    Attributes:
        test: name of the test; of the session for a bar.
        runs: label of the run, or of the runs of one putting-up.
        size_um: how far off: rms of a run, distance of a ball from its place, error of a bar's length [µm].
        uncertainty_um: standard uncertainty of the size; None for a run [µm].
        shift_um: where a ball stands, machine axes; None for a run [µm].
        text: what it looks like, in words.
        sure: False where a badly seated ball cannot be told from a wrong CMM row: it was put up once only.
        alike: error sources that would explain the recordings about as well in its place.
        freed: names of the mountings that may stand anywhere, or of the session whose bar may have any length.
        why: end of the text, what it may come from.
    """

    kind: OutlierKind
    test: str
    runs: str
    size_um: float
    uncertainty_um: float | None = None
    shift_um: tuple[float, float, float] | None = None
    text: str
    sure: Annotated[bool, Kept] = True
    alike: Annotated[tuple[str, ...], Kept] = ()
    freed: Annotated[tuple[str, ...], Kept] = ()
    why: Annotated[str, Kept] = ""
