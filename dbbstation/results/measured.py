"""A session as it was measured: the result of `measure`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from dbbstation.facts.serialise import Absent
from dbbstation.quality.finding import Finding


@dataclass(frozen=True, kw_only=True)
class RecordedRun:
    """A run of the session.

    Attributes:
        direction: `ccw` or `cw`.
        repeat: counts runs of this test and direction.
        mounting: of the ball; None where nobody counted.
    """

    test: str
    direction: str
    repeat: int
    mounting: int | None
    state: str
    file: str


@dataclass(frozen=True, kw_only=True)
class CompletedRun(RecordedRun):
    """A run that was measured now, with its first figures.

    Attributes:
        lost: samples that did not arrive.
        doubtful: samples that the instrument marked.
        problem: why it shows no circle; None where it does.
        centre_deviation_um: absent where it shows no circle [µm].
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
        state: of the sequence when it ended.
        fault: what ended it; None for none.
        planned: runs of the plan.
        missing: of them, as people read them.
    """

    session: str
    state: str
    fault: str | None
    planned: int
    accepted: int
    missing: tuple[str, ...]
    runs: tuple[CompletedRun | RecordedRun, ...]
