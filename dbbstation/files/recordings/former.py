"""Find earlier sessions of the same machine, plan and jig."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.files.formats.session import RunState
from dbbstation.files.recorded_ground import SESSION_FILE
from dbbstation.files.recordings.session import parse_session
from dbbstation.machine.difference import differences

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from datetime import datetime
    from pathlib import Path

    from dbbstation.errors import Problem
    from dbbstation.files.recordings.session import SessionFolder

DEPTH = 2
"""Searched levels of subfolders, such as one per machine, then one per month."""

MOST = 30
"""Greatest number of sessions that are read, the newest first; each needs some hundredths of a second."""


def former_sessions(
    now: SessionFolder, under: Path, tests: set[str] | None = None
) -> list[tuple[datetime, SessionFolder]]:
    """Return earlier sessions of the same machine, plan and jig, the latest first. A real session gets only real ones, a virtual session only virtual ones."""
    accepted = now.in_state(RunState.ACCEPTED)
    began = min((run.started for run in accepted if run.started is not None), default=None)
    tests = tests or {run.test for run in accepted} or set(now.plan.tests)
    found = []
    for _, folder in dated_folders(under):
        if folder == now.folder.absolute():
            continue
        faults: list[Problem] = []
        then = parse_session(
            folder, faults
        )  # not `read_session`: a virtual neighbour would mark this session's outputs
        if then is None or faults:
            continue  # the list of sessions says what is wrong with it
        runs = then.in_state(RunState.ACCEPTED)
        ended = max((run.started for run in runs if run.started is not None), default=None)
        measured = {run.test for run in runs}
        if ended is not None and (began is None or ended < began) and tests <= measured and _alike(now, then, tests):
            found.append((ended, then))
    return sorted(found, key=lambda one: one[0], reverse=True)


def dated_folders(under: Path, remembered: Iterable[Path] = ()) -> list[tuple[float, Path]]:
    """Return session folders with their files' times [s since 1970]; arguments as of `list_sessions`."""
    folders = {folder.absolute() for folder in (*_found(under, DEPTH), *remembered)}
    dated = []
    for folder in folders:
        try:
            dated.append(((folder / SESSION_FILE).stat().st_mtime, folder))
        except OSError:
            continue
    dated.sort(key=lambda one: (-one[0], one[1]))
    return dated[:MOST]


def _found(folder: Path, depth: int) -> Iterator[Path]:
    try:
        inside = sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))
        is_session = (folder / SESSION_FILE).is_file()
    except OSError:
        return
    if is_session:
        yield folder
    elif depth:
        for path in inside:
            yield from _found(path, depth - 1)


def _alike(now: SessionFolder, then: SessionFolder, tests: set[str]) -> bool:
    if bool(now.virtual) is not bool(then.virtual):
        return False
    serials = {one.serial_number for one in (now, then) if one.serial_number}
    same = all(
        name in now.plan.tests
        and name in then.plan.tests
        and (now.plan.tests[name].ball, now.plan.tests[name].circle)
        == (then.plan.tests[name].ball, then.plan.tests[name].circle)
        for name in tests
    )
    return len(serials) < 2 and same and not differences(now.machine, then.machine)  # noqa: PLR2004 - two different ones
