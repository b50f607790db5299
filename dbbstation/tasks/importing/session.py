"""Write imported runs as a sealed session, after a trial in a temporary folder."""

from __future__ import annotations

import json
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from dbbstation.errors import InputError, OutputError, Problem, TraceError, refuse
from dbbstation.files.formats.mapping import mapping_text
from dbbstation.files.formats.session import RunState
from dbbstation.files.recordings.new_session import write_session
from dbbstation.files.recordings.session import read_session
from dbbstation.system.replacing import remove_tree, rename, sync_folder
from dbbstation.trace.cut import cut

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from dbbstation.files.formats.mapping import MappingFile
    from dbbstation.files.formats.plan import PlanFile
    from dbbstation.files.formats.session import SessionDetails
    from dbbstation.files.provenance import Provenance
    from dbbstation.machine.geometry import Machine
    from dbbstation.tasks.importing.runs import ImportedRun

IMPORTED = "imported"
"""Folder in the session with the original files, the mapping, and the import's statements."""


def originals(
    tables: Mapping[Path, bytes], mapping: MappingFile, provenance: Provenance, statements: Sequence[str]
) -> dict[str, str | bytes]:
    """Return the files of the import that the session keeps, as content by relative path."""
    names: dict[str, bytes] = {}
    for path, data in tables.items():
        name, k = path.name, 2
        while name in names:
            name, k = f"{path.stem} ({k}){path.suffix}", k + 1
        names[name] = data
    kept: dict[str, str | bytes] = {f"{IMPORTED}/files/{name}": data for name, data in names.items()}
    told = {**provenance.data(), "statements": list(statements)}
    kept[f"{IMPORTED}/mapping.yaml"] = mapping_text(mapping)
    kept[f"{IMPORTED}/provenance.json"] = json.dumps(told, indent=1, ensure_ascii=False) + "\n"
    return kept


@dataclass(frozen=True)
class ImportedSession:
    """All that a session is written from, with the statements about it and further files."""

    mapping: MappingFile
    plan: PlanFile
    machine: Machine
    runs: Sequence[ImportedRun]
    details: SessionDetails
    statements: Sequence[str]
    more: Mapping[str, str | bytes]


@contextmanager
def staged(folder: Path, found: ImportedSession, *, dry: bool) -> Iterator[Callable[[], None]]:
    """Write a session into a temporary folder, read it and cut every accepted run. Yield a function that moves it to its place; otherwise it is removed.

    Args:
        dry: never move it; use the system's temporary folder.

    Raises:
        InputError: no circle of the plan has a run's lengths, times or angles.
        OutputError: the folder exists, or cannot be written.
    """
    if folder.exists():
        raise OutputError("the session folder exists already", where=str(folder), remedy="choose another name")
    if not folder.parent.is_dir():
        what = f"cannot be written: there is no folder {folder.parent}"
        raise OutputError(what, where=str(folder), remedy="make the folder, or name another")
    beside = None if dry else folder.parent
    try:
        made = Path(tempfile.mkdtemp(prefix=f".{folder.name}", suffix=".new", dir=beside))
    except OSError as error:
        raise OutputError(f"cannot be written: {error.strerror}", where=str(folder), remedy="check the disk") from error
    try:
        written = made / folder.name
        runs = [one.run for one in found.runs]
        write_session(written, found.machine, found.plan, runs, found.details, found.more, datetime.now(UTC))
        _try_out(written, found.runs)

        def put() -> None:
            rename(written, folder)
            sync_folder(folder.parent)

        yield put
    finally:
        remove_tree(made)


def _try_out(folder: Path, runs: Sequence[ImportedRun]) -> None:
    session = read_session(folder)
    faults: list[Problem] = []
    for one, entry in zip(runs, session.runs, strict=True):
        try:
            recording = session.load(entry).recording
            if entry.state is not RunState.REJECTED:
                cut(recording, session.circle(entry))
        except InputError as error:
            # Columns have other names in the file that they come from, and rows other lines.
            faults += [
                replace(fault, file=one.file, line=0, what=f"as run {one.run.label}: {fault.what}")
                for fault in error.problems
            ]
        except TraceError as error:
            faults.append(Problem.of(one.file, f"as run {one.run.label}: {error.what}", error.remedy))
    refuse(faults)
