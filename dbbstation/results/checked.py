"""The result of `check`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from dbbstation.errors import Problem
from dbbstation.facts.serialise import Absent, Kept
from dbbstation.plan.sampling import SampledCircle
from dbbstation.quality.finding import Finding


@dataclass(frozen=True)
class CheckedRun:
    """A run of a session."""

    run: str
    findings: tuple[Finding, ...]


@dataclass(frozen=True)
class CheckedFile:
    """A file, or a session.

    Attributes:
        runs: judged runs of a session; else absent.
        virtual: whether a session's machine is virtual; absent if unknown.
    """

    file: str
    format: str
    ok: bool
    summary: str
    runs: Annotated[tuple[CheckedRun, ...] | None, Absent] = None
    virtual: Annotated[bool | None, Absent] = None


@dataclass(frozen=True)
class DryRunResult:
    """Dry run of a plan's programs."""

    plan: str
    machine: str
    programs: int
    ok: bool
    problems: Annotated[tuple[Problem, ...], Kept]


@dataclass(frozen=True)
class SampledPlanResult:
    """The readings of an instrument on a plan's circles."""

    plan: str
    circles: tuple[SampledCircle, ...]
    notes: Annotated[tuple[str, ...], Kept]


@dataclass(frozen=True)
class CheckResult:
    """Findings of `check`."""

    files: tuple[CheckedFile, ...]
    dry_runs: tuple[DryRunResult, ...]
    sampling: tuple[SampledPlanResult, ...]
    problems: tuple[Problem, ...]
    warnings: tuple[Problem, ...]
