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
        test: name of its test.
        direction: `ccw` or `cw`.
        repeat: counts runs of this test and direction.
        mounting: of the ball; None where nobody counted.
        state: what was decided of it.
        file: of its recording, in the session's folder.
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
        samples: in its recording.
        lost: samples that did not arrive.
        doubtful: samples that the instrument marked.
        problem: why it shows no circle; None where it does.
        findings: what was found of it.
        centre_deviation_um: absent where it shows no circle [µm].
        mean_radial_error_um: likewise [µm].
        circularity_um: likewise [µm].
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
        session: its folder.
        state: of the sequence when it ended.
        fault: what ended it; None for none.
        planned: runs of the plan.
        accepted: of them.
        missing: of them, as people read them.
        runs: that it has.
    """

    session: str
    state: str
    fault: str | None
    planned: int
    accepted: int
    missing: tuple[str, ...]
    runs: tuple[CompletedRun | RecordedRun, ...]
