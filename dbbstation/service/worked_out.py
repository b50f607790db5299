"""What was worked out of a session before, so that it stands there when the session is opened again."""

from __future__ import annotations

import hashlib
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pydantic import BaseModel, ConfigDict, ValidationError

from dbbstation.errors import InputError, OutputError
from dbbstation.files.atomic import write_text
from dbbstation.files.gateway import content_of
from dbbstation.files.recordings.entries import RunState
from dbbstation.files.recordings.session import read_session

if TYPE_CHECKING:
    from pathlib import Path

FILE = "worked-out.json"
"""Name of the file in a folder of results."""

LARGEST_BYTES = 50_000_000
"""Largest such file that is read: what the commands answered, some megabytes for a large session."""


class DoneStep(BaseModel):
    """A step that was done."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    path: str
    """What it wrote, in the folder of results."""
    passed_s: float
    """How long it took [s]."""
    answer: dict[str, object]
    """What its command printed."""


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid")

    runs_sha256: str
    """Of the runs that counted when it was worked out."""
    steps: dict[str, DoneStep]


@dataclass(frozen=True)
class StepsBefore:
    """What was done with the runs that count now.

    Attributes:
        folder: of the results.
        counted: SHA-256 of the runs that count.
        steps: what was done, by the name of the step.
    """

    folder: Path
    counted: str
    steps: dict[str, DoneStep]


def keep_steps(folder: Path, runs_sha256: str, steps: dict[str, DoneStep]) -> None:
    """Keep what was done beside its results; where that cannot be written, only the next start lacks it.

    Args:
        folder: of the results.
        runs_sha256: of the runs that count, as `counted` has it.
        steps: what was done, by the name of the step.
    """
    with suppress(OSError, OutputError):
        file = _File(runs_sha256=runs_sha256, steps=steps)
        write_text(folder / FILE, file.model_dump_json(indent=1) + "\n", force=True, rewrites=True)


def steps_before(session: Path) -> StepsBefore | None:
    """Return the last folder of results of a session whose counting runs are still the same, and what was done; None where none is.

    A step whose file is gone is left out.

    Args:
        session: its folder.
    """
    session = session.absolute()
    kept = sorted(session.parent.glob(f"{session.name}-results*/{FILE}"), key=lambda file: -file.stat().st_mtime)
    try:
        now = counted(session) if kept else ""
    except InputError:  # what is wrong with it is said where it is opened
        return None
    for file in kept:
        try:
            found = _File.model_validate_json(content_of(file, LARGEST_BYTES))
        except (OSError, ValidationError):
            continue
        if found.runs_sha256 == now:
            folder = file.parent
            steps = {name: step for name, step in found.steps.items() if (folder / step.path).exists()}
            return StepsBefore(folder, now, steps)
    return None


def counted(session: Path) -> str:
    """Return the SHA-256 of which runs of a session count, and of their files.

    Raises:
        InputError: faults of the session.
    """
    runs = sorted(f"{run.label} {run.sha256}" for run in read_session(session).in_state(RunState.ACCEPTED))
    return hashlib.sha256("\n".join(runs).encode()).hexdigest()
