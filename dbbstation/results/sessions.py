"""The results of `session list`, `session log`, `measure` and `simulate`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from dbbstation.facts import OfRun
from dbbstation.facts.serialise import Absent, AsItIs, Kept
from dbbstation.files.formats.session import Counts
from dbbstation.files.provenance import Provenance
from dbbstation.quality.finding import Finding
from dbbstation.results.frame import Framed
from dbbstation.trace.recording import Recording


@dataclass(frozen=True)
class ListedRun:
    """A run of a session."""

    run: str
    test: str
    direction: str
    repeat: int
    mounting: int | None
    started: str | None
    state: str
    reason: str | None
    counts: Counts | None
    file: str


@dataclass(frozen=True)
class ListedSession:
    """The runs of a session.

    Attributes:
        virtual: whether the machine is virtual; None if unknown.
    """

    session: str
    virtual: bool | None
    runs: tuple[ListedRun, ...]
    missing: tuple[str, ...]


@dataclass(frozen=True)
class ListedEvent:
    """An event of a session."""

    event: int
    at: str | None
    what: str
    about: str
    link: str


@dataclass(frozen=True)
class SessionEvents:
    """The event log of a session.

    Attributes:
        anchor: last link of the hash chain; None without a log.
    """

    session: str
    events: tuple[ListedEvent, ...]
    anchor: str | None


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedSession(Framed):
    """A simulated session.

    Attributes:
        writing: writes it to a new folder.
    """

    session: str | None = None
    runs: int
    tests: tuple[str, ...]
    recordings: Annotated[Mapping[str, Recording], AsItIs, Kept]
    writing: Annotated[Callable[[Path], None], AsItIs, Kept]

    def headline(self) -> str:
        """Return the number of runs."""
        return f"{self.runs} runs of {', '.join(self.tests)}"

    def rows(self) -> list[dict[str, object]]:
        """Return one row per run."""
        return [
            {"run": name, "samples": len(one), "mean_length_mm": float(one.length_mm.mean())}
            for name, one in self.recordings.items()
        ]

    def _save(self, path: Path, provenance: Provenance, *, force: bool) -> None:  # noqa: ARG002 - a session replaces none
        self.writing(path)


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
