"""Keys of stored results: hashes of all inputs that determine a result."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dbbstation.files.formats.session import RunState
from dbbstation.files.gateway import digest_of
from dbbstation.files.program_identity import program_identity
from dbbstation.files.recordings.session_name import SESSION_FILE

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from dbbstation.files.recordings.session import SessionFolder


def key_of(request: Mapping[str, Any], inputs: Iterable[tuple[str, str]] = ()) -> str:
    """Return a SHA-256 over request, inputs and program.

    Args:
        inputs: name and SHA-256 of each file, in any order.
    """
    what = {"request": request, "inputs": sorted(inputs), "program": program_identity()}
    return hashlib.sha256(json.dumps(what, sort_keys=True, default=str).encode()).hexdigest()


def digests_of(paths: Iterable[Path], folder: Path) -> list[tuple[str, str]]:
    """Return name and SHA-256 of files; names within a folder are relative to it.

    Raises:
        OSError: one cannot be read.
    """
    return [(Path(os.path.relpath(path, folder)).as_posix(), digest_of(path)) for path in dict.fromkeys(paths)]


def files_of_session(session: SessionFolder) -> list[Path]:
    """Return the files that determine a session's results: session file, machine, plan, accepted runs, programs."""
    runs = [run for run in session.runs if run.state is RunState.ACCEPTED]
    programs = [run.program.path for run in runs if run.program is not None]
    return [
        session.folder / SESSION_FILE,
        session.machine_path,
        session.plan_path,
        *(run.path for run in runs),
        *programs,
    ]
