"""Read the histories of a folder's sessions through an index."""

from __future__ import annotations

import os
from contextlib import closing
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from dbbstation.computing.counted import uncounted
from dbbstation.computing.grouped import grouped
from dbbstation.errors import InputError, StationError
from dbbstation.facts.serialise import json_of, read_json
from dbbstation.files.gateway import digest_of
from dbbstation.files.inputs import note_known
from dbbstation.files.kept import Kept, NotedAnchor, stamp_of
from dbbstation.files.keys import key_of
from dbbstation.files.places import SESSION_FILE
from dbbstation.files.recordings.event_log import SHORTEST, links_of
from dbbstation.files.recordings.former import files_of, reason_of
from dbbstation.history.order import date_faults
from dbbstation.history.record import ModelFigures, SessionFigures
from dbbstation.history.trend import histories
from dbbstation.results.history import history_result
from dbbstation.system.processes import each
from dbbstation.text.written import listed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from os import PathLike

    from dbbstation.computing.counted import Counted
    from dbbstation.history.trend import TrendOptions
    from dbbstation.results.history import HistoryResult


def histories_in(
    folder: str | PathLike[str],
    asked: TrendOptions,
    source_files: Sequence[Path] = (),
    *,
    rebuild: bool = False,
    counted: Counted = uncounted,
) -> HistoryResult:
    """Return the histories of all machines with sessions in a folder, at most four levels deep.

    Args:
        folder: with sessions, and models of `calibrate` or `diagnose`.
        rebuild: ignore the index.

    Raises:
        InputError: no usable session; an unknown test.
        StoppedError: `stop` returned True; the index keeps the figures read so far.
    """
    folder = Path(folder)
    found = files_of(folder)
    with Kept(folder, begin_anew=rebuild) as kept:
        reading = _Reading(kept, counted, len(found.sessions) + len(found.models))
        read = reading.every(found.sessions, SessionFigures, _session_data, _beside, _processes_for)
        sessions = [replace(one, name=_called(name)) for name, one in read.items()]
        work = partial(_model_data, source_files=tuple(source_files))
        models = [
            replace(one, file=name)
            for name, one in reading.every(found.models, ModelFigures, work, lambda _model: source_files).items()
        ]
        kept.drop_others([*found.sessions, *found.models])
        moment = datetime.now(UTC)
        folders = {_called(name): path.parent for name, path in found.sessions.items()}
        seals = [note for one in sessions if (note := _seal_note(kept, folders[one.name], one, moment))]
        notes = [*([kept.problem] if kept.problem else []), *seals]
    counted(reading.of, reading.of)
    sessions, alike = _once(sessions)
    dated = [one for one in sessions if one.started is not None]
    left_out = [*found.closed, *reading.left_out] + [
        (one.name, "none of its accepted runs says when it started: it has no place in time")
        for one in sessions
        if one.started is None
    ]
    if not dated:
        first = f": {left_out[0][0]}: {left_out[0][1]}" if left_out else ""
        what = f"none of its {len(found.sessions)} sessions can be used{first}"
        raise InputError.of(folder, what, "`dbbstation check SESSION` names every fault")
    _check_tests(folder, dated, asked)
    by_session, unlike = _of_one_session(models, dated)
    notes = [*unlike, *notes, *alike]
    machines = histories(dated, by_session, asked)
    for machine in machines:
        notes += date_faults(machine.sessions, moment)
        notes += _gathered(machine.sessions)
    warned = {one.name: by_session[one.sha256].warnings for one in dated if one.sha256 in by_session}
    return history_result(machines, asked, left_out, notes, reading.worked_out, warned)


def _seal_note(kept: Kept, folder: Path, one: SessionFigures, moment: datetime) -> str:
    noted = kept.noted(one.name)
    if noted is None or noted.anchor == one.anchor or noted.anchor in links_of(folder):
        if one.anchor and (noted is None or noted.anchor != one.anchor):
            kept.note(one.name, NotedAnchor(one.anchor, moment.isoformat(timespec="seconds")))
        return ""
    before = f"one ended with {noted.anchor[:SHORTEST]} on {noted.at[:10]}"
    if not one.anchor:
        return f"{one.name} carries no seal, {before}: the seal was taken out"
    return (
        f"{one.name} carries another seal, {before}, which is not part of it: it was sealed anew, or is another session"
    )


_Kind = TypeVar("_Kind", SessionFigures, ModelFigures)


class _Reading:
    def __init__(self, kept: Kept, progress: Counted, of: int) -> None:
        self.of = of
        self.left_out: list[tuple[str, str]] = []
        self.worked_out = 0
        self._kept = kept
        self._progress = progress
        self._done = 0

    def every(
        self,
        files: Mapping[str, Path],
        kind: type[_Kind],
        work: Callable[[Path], _Kind],
        others: Callable[[Path], Sequence[Path]],
        processes: Callable[[Sequence[Path]], int] = lambda _paths: 1,
    ) -> dict[str, _Kind]:
        """Return the figures of readable files in order."""
        found: dict[str, _Kind] = {}
        reasons: dict[str, str] = {}
        unknown: dict[str, list[tuple[str, str]]] = {}  # names and stamps of files with one content
        for name, path in files.items():
            try:
                more = others(path)
                stamp = stamp_of(path, *more)
                one = _understood(kind, self._kept.of(name, stamp))
                if one is None:
                    digest = key_of({"task": kind.__name__}, _contents(path, more))
                    text = self._kept.of_content(digest)
                    one = _understood(kind, text)
                    if text is None or one is None:
                        unknown.setdefault(digest, []).append((name, stamp))
                        continue
                    self._kept.keep(name, stamp, digest, text)
                found[name] = one
            except OSError as error:
                reasons[name] = reason_of(error)
            self._count()
        digests, paths = list(unknown), [files[same[0][0]] for same in unknown.values()]
        with closing(each(partial(_tried, work), paths, processes(paths))) as outcomes:
            for place, outcome in outcomes:
                digest = digests[place]
                self.worked_out += 1
                for name, stamp in unknown[digest]:
                    if isinstance(outcome, str):
                        reasons[name] = outcome
                    else:
                        found[name] = outcome
                        self._kept.keep(name, stamp, digest, json_of(outcome, indent=None, escaped=True))
                    self._count()
        self.left_out += [(_called(name), reasons[name]) for name in files if name in reasons]
        for name in (name for name in files if name in found):
            note_known(files[name], found[name].sha256)
        return {name: found[name] for name in files if name in found}

    def _count(self) -> None:
        self._done += 1
        self._progress(self._done, self.of)


def _beside(session_file: Path) -> list[Path]:
    folder = session_file.parent
    names = sorted(os.path.join(place, name) for place, _, here in os.walk(folder) for name in here)  # noqa: PTH118 - hundreds of folders
    return [Path(name) for name in names if name != str(session_file) and os.path.isfile(name)]  # noqa: PTH113 - the same


def _contents(path: Path, others: Sequence[Path]) -> list[tuple[str, str]]:
    found = [("", digest_of(path))]
    for other in others:
        name = os.path.relpath(other, path.parent)
        try:
            found.append((name, digest_of(other)))
        except OSError:
            found.append((name, ""))
    return found


RUNS_WORTH_PROCESSES = 300
"""Least number of recordings for which further processes save time: ten seconds of work, since a process needs two to
start."""


def _processes_for(sessions: Sequence[Path]) -> int:
    runs = sum(1 for path in sessions for _ in path.parent.glob("runs/*.csv"))
    return min(os.cpu_count() or 1, len(sessions)) if runs >= RUNS_WORTH_PROCESSES else 1


def _session_data(path: Path) -> SessionFigures:
    from dbbstation.tasks.session_figures import session_figures

    return session_figures(path.parent)


def _model_data(path: Path, source_files: Sequence[Path]) -> ModelFigures:
    from dbbstation.tasks.session_figures import model_figures

    return model_figures(path, source_files)


def _tried(work: Callable[[Path], _Kind], path: Path) -> _Kind | str:
    """Return a file's figures, or why it cannot be read."""
    try:
        return work(path)
    except OSError as error:
        return reason_of(error)
    except StationError as error:
        lines = str(error).splitlines()
        return lines[0] + (f" (and {len(lines) - 1} more)" if len(lines) > 1 else "")


def _called(name: str) -> str:
    return name.removesuffix(f"/{SESSION_FILE}")


def _understood(kind: type[_Kind], text: str | None) -> _Kind | None:
    try:
        return None if text is None else read_json(kind, text)
    except ValueError:
        return None


MOST_NAMED = 3
"""Greatest number of sessions that are named if many have the same remark."""


def _gathered(sessions: Sequence[SessionFigures]) -> list[str]:
    by_text = grouped((note, one.name) for one in sessions for note in one.notes)
    return [f"{listed(names, MOST_NAMED)}: {note}" for note, names in by_text.items()]


def _once(sessions: Iterable[SessionFigures]) -> tuple[list[SessionFigures], list[str]]:
    first: dict[str, SessionFigures] = {}
    notes = []
    for one in sessions:
        before = first.setdefault(one.sha256, one)
        if before is not one:
            notes.append(
                f"{one.name} is a copy of {before.name}, by the SHA-256 of its session file: it is counted once"
            )
    return list(first.values()), notes


def _check_tests(folder: Path, sessions: Sequence[SessionFigures], asked: TrendOptions) -> None:
    known = {run.test for one in sessions for run in one.runs}
    unknown = [name for name in (*asked.tests, *asked.exclude) if name not in known]
    if unknown:
        what = f"no session has a test {', '.join(unknown)}"
        raise InputError.of(folder, what, f"tests are {', '.join(sorted(known))}")


def _of_one_session(
    models: Sequence[ModelFigures], sessions: Sequence[SessionFigures]
) -> tuple[dict[str, ModelFigures], list[str]]:
    known = {one.sha256: one.name for one in sessions}
    taken: dict[str, ModelFigures] = {}
    notes = []
    for model in sorted(models, key=lambda one: (-len(one.parameters), one.file)):
        if len(model.sessions) != 1:
            notes.append(
                f"{model.file} comes from {len(model.sessions)} sessions together: it is no value of one of them"
            )
            continue
        ((name, digest),) = model.sessions.items()
        if digest not in known:
            notes.append(f"{model.file} comes from a session {name} that is not here, or was changed since")
        elif taken.setdefault(digest, model) is not model:
            other = taken[digest].file
            notes.append(f"{model.file} and {other} are of one session, {known[digest]}: {other} is taken")
    said = [f"{one.file}: {text}" for one in taken.values() for text in one.warnings]
    notes = [*said, *notes]  # of numbers that are shown, before those that are not
    return taken, notes
