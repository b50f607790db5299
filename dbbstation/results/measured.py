"""The result of `measure`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from dbbstation.facts.run import OfRun
from dbbstation.facts.serialise import Absent
from dbbstation.quality.finding import Finding


@dataclass(frozen=True, kw_only=True)
class RecordedRun(OfRun):
    """A run of the session.

    Attributes:
        mounting: of the ball; None if not counted.
    """

    mounting: int | None
    state: str
    file: str


@dataclass(frozen=True, kw_only=True)
class CompletedRun(RecordedRun):
    """A newly measured run with its first figures.

    Attributes:
        lost: missing samples.
        doubtful: samples marked by the instrument.
        problem: None with a circle.
        centre_deviation_um: absent without a circle.
    """

    samples: int
    lost: int
    doubtful: int
    problem: str | None
    findings: tuple[Finding, ...]
    centre_deviation_um: Annotated[float | None, Absent] = None
    mean_radial_error_um: Annotated[float | None, Absent] = None
    circularity_um: Annotated[float | None, Absent] = None


@dataclass(frozen=True)
class MeasuredSession:
    """A session.

    Attributes:
        state: of the sequence at its end.
        fault: that ended it, or None.
    """

    session: str
    state: str
    fault: str | None
    planned: int
    accepted: int
    missing: tuple[str, ...]
    runs: tuple[CompletedRun | RecordedRun, ...]
