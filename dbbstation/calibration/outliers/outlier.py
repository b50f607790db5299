"""Outliers among a session's runs."""

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
"""A run is an outlier if its residual is this many times the usual residual ..."""

LEAST_UM = 3.0
"""... and larger than a bar's noise can be [µm]."""


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
"""Error source with a value beyond its stated size; a run that is no circle of this machine has no such source."""


@dataclass(frozen=True, kw_only=True)
class Outlier:
    """An outlier whose influence on the fit is removed.

    Attributes:
        test: name of the test, or of the session for a bar.
        size_um: residual rms of a run, displacement of a ball, or length error of a bar.
        shift_um: of a ball, machine axes; None for a run.
        sure: False if a single mounting cannot distinguish a badly seated ball from a wrong CMM row.
        alike: other error sources that explain it about equally well.
        freed: mountings with free ball, or session with free bar.
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
