"""What is wrong with files, and what was found beside: the result of `check`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from dbbstation.errors import Problem
from dbbstation.facts.serialise import Absent
from dbbstation.quality.finding import Finding
from dbbstation.results.sampling import SampledCircle


@dataclass(frozen=True)
class CheckedRun:
    """A run of a session."""

    run: str
    findings: tuple[Finding, ...]


@dataclass(frozen=True)
class CheckedFile:
    """A file, or a session.

    Attributes:
        ok: whether nothing is wrong with it.
        runs: of a session whose runs were judged; absent else.
    """

    file: str
    format: str
    ok: bool
    summary: str
    runs: Annotated[tuple[CheckedRun, ...] | None, Absent] = None


@dataclass(frozen=True)
class DryRunResult:
    """The programs of a plan, tried on a machine."""

    plan: str
    machine: str
    programs: int
    ok: bool


@dataclass(frozen=True)
class SampledPlanResult:
    """What an instrument sees of a plan."""

    plan: str
    circles: tuple[SampledCircle, ...]


@dataclass(frozen=True)
class CheckResult:
    """What `check` found.

    Attributes:
        warnings: what is worth knowing.
    """

    files: tuple[CheckedFile, ...]
    dry_runs: tuple[DryRunResult, ...]
    sampling: tuple[SampledPlanResult, ...]
    problems: tuple[Problem, ...]
    warnings: tuple[Problem, ...]
