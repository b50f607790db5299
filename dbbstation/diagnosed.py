"""The diagnosis of recorded sessions, from their files to what is said of them: one way in for command and studies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dbbstation.calibration.fit.calibrate import default_sources
from dbbstation.diagnosis.diagnose import diagnose, usable_sources
from dbbstation.diagnosis.summary import diagnosis_summary
from dbbstation.errors import ModelError
from dbbstation.recorded import Recorded, load_sessions
from dbbstation.sources.registry import known_sources, sources_named

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from dbbstation.diagnosis.findings import Diagnosis
    from dbbstation.sources.contract import ErrorSource


@dataclass(frozen=True, eq=False)
class Diagnosed:
    """Recorded sessions with their diagnosis.

    Attributes:
        recorded: the sessions.
        diagnosis: what was found in them.
        lacking: why further candidates could not be looked at, by name.
    """

    recorded: Recorded
    diagnosis: Diagnosis
    lacking: Mapping[str, str]

    def summary(self) -> dict[str, Any]:
        """Everything that is said, as plain numbers."""
        return diagnosis_summary(self.diagnosis, self.lacking)


def default_candidates(known: Mapping[str, ErrorSource]) -> list[str]:
    """Names of all error sources that are not fitted anyway."""
    fitted = {source.name for source in default_sources()}
    return [name for name, source in known.items() if name not in fitted and source.candidate]


def diagnose_sessions(
    paths: Sequence[Path],
    candidates: Sequence[str] | None,
    exclude: Sequence[str],
    say: Callable[[str], None],
    known: Mapping[str, ErrorSource] | None = None,
    progress: Callable[[str], None] = lambda _: None,
    reading: Callable[[int, int], None] = lambda _done, _of: None,
    only: Sequence[str] = (),
) -> Diagnosed:
    """Read sessions of one machine and find what a kinematic calibration of them leaves out.

    Args:
        paths: session folders or session files.
        candidates: names of the error sources to look for; all that are known if None.
        exclude: names of tests to leave out.
        say: told what was noticed in the files.
        known: every error source by name; those of the package if None.
        progress: told each stage of the work as it begins.
        reading: told how many runs of a session, of how many, are read.
        only: names of tests to take; empty for all.

    Raises:
        InputError: faults of files and traces.
        ModelError: a name that no source has, or that of a source that is no cause.
        CalibrationError: the kinematic model cannot be fitted.
    """
    known = known_sources() if known is None else known
    named = sources_named(default_candidates(known) if candidates is None else candidates, known)
    for source in named:
        if not source.candidate:
            what = f"{source.name} is no cause: it only keeps in a model what a diagnosis left without a name"
            raise ModelError(what, remedy="leave it out; --keep-unexplained keeps what is left")
    recorded = load_sessions(paths, exclude, reading, only)
    for warning in recorded.warnings:
        say(f"note: {warning}")
    usable, lacking = usable_sources(recorded.machine, recorded.observations, named)
    found = diagnose(recorded.machine, recorded.observations, usable, progress)
    return Diagnosed(recorded, found, lacking)
