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
    """An outlier kept out of the fit.

    Attributes:
        test: or session, for a bar.
        size_um: rms of a run, displacement of a ball, error of a bar's length.
        uncertainty_um: standard; None for a run.
        shift_um: of a ball, machine axes; None for a run.
        sure: False if one mounting cannot separate a bad seat from a wrong CMM row.
        alike: error sources of about equal explanation.
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
