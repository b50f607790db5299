"""The result of `measure`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from dbbstation.facts.run import OfRun
from dbbstation.facts.serialise import Absent
from dbbstation.quality.finding import Finding


@dataclass(frozen=True, kw_only=True)
class RecordedRun(OfRun):
    """A run of the session."""

    mounting: int | None
    state: str
    file: str


@dataclass(frozen=True, kw_only=True)
class CompletedRun(RecordedRun):
    """A newly measured run with its first figures."""

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
    """A session after its measurement."""

    session: str
    state: str
    fault: str | None
    planned: int
    accepted: int
    missing: tuple[str, ...]
    runs: tuple[CompletedRun | RecordedRun, ...]
