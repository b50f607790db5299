"""Earlier results of a session, shown when it is reopened."""

from __future__ import annotations

import glob
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pydantic import BaseModel, ConfigDict, ValidationError

from dbbstation.errors import InputError, OutputError
from dbbstation.files.atomic import write_text
from dbbstation.files.gateway import content_of
from dbbstation.files.keys import digests_of, files_of_session, key_of
from dbbstation.files.places import real_path
from dbbstation.files.recordings.session import read_session
from dbbstation.service.job import SessionTask

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

    key: str
    """Of what decided it, as `counted` has it."""
    steps: dict[str, DoneStep]


@dataclass(frozen=True)
class StepsBefore:
    """What was done with a session as it is now."""

    folder: Path
    counted: str
    steps: dict[str, DoneStep]


def keep_steps(folder: Path, key: str, steps: dict[str, DoneStep]) -> None:
    """Keep finished steps beside their results, if possible; another screen's steps of the session are kept."""
    with suppress(OSError, OutputError):
        before = _kept(folder / FILE)
        if before is not None and before.key == key:
            steps = before.steps | steps
        file = _File(key=key, steps=steps)
        write_text(folder / FILE, file.model_dump_json(indent=1) + "\n", force=True, rewrites=True)


def steps_before(session: Path) -> StepsBefore | None:
    """Return the last results of an unchanged session, or None."""
    session = session.absolute()
    kept = sorted(
        session.parent.glob(f"{glob.escape(session.name)}-results*/{FILE}"), key=lambda file: -file.stat().st_mtime
    )
    try:
        now = counted(session) if kept else ""
    except (InputError, OSError):  # what is wrong with it is said where it is opened
        return None
    for file in kept:
        found = _kept(file)
        if found is not None and found.key == now:
            folder = file.parent
            steps = {name: step for name, step in found.steps.items() if _is_result(folder, name, step)}
            return StepsBefore(folder, now, steps)
    return None


def _kept(file: Path) -> _File | None:
    try:
        return _File.model_validate_json(content_of(file, LARGEST_BYTES))
    except (OSError, ValidationError):
        return None


def _is_result(folder: Path, name: str, step: DoneStep) -> bool:
    path = folder / step.path
    return name in set(SessionTask) and path.exists() and real_path(path).is_relative_to(real_path(folder))


def counted(session: Path) -> str:
    """Return the key of a session's results: its files and the program.

    Raises:
        InputError: faults of the session.
        OSError: a file cannot be read.
    """
    found = read_session(session)
    return key_of({"task": "steps"}, digests_of(files_of_session(found), found.folder))
