"""From a folder of sessions to the histories of its machines, by an index of what was worked out of each session before."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, TypeVar

from dbbstation.errors import InputError, Problem, StationError
from dbbstation.files.inputs import note_known
from dbbstation.files.kept import Kept, stamp_of
from dbbstation.files.recordings.folder_of_sessions import files_of, reason_of
from dbbstation.files.recordings.session import SESSION_FILE
from dbbstation.history.order import date_faults
from dbbstation.history.record import Figure, ModelFigures, ModelParameter, RunFigures, SessionFigures
from dbbstation.history.trend import histories

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from pathlib import Path

    from dbbstation.history.trend import Asked, MachineHistory


@dataclass(frozen=True)
class Historied:
    """Histories of a folder.

    Attributes:
        machines: one for each machine.
        left_out: sessions and models that could not be read, by name, with the reason.
        notes: what else is to be said.
        worked_out: sessions and models that were read now; the others came from the index.
    """

    machines: tuple[MachineHistory, ...]
    left_out: tuple[tuple[str, str], ...]
    notes: tuple[str, ...]
    worked_out: int


def load_history(
    folder: Path,
    asked: Asked,
    source_files: Sequence[Path] = (),
    *,
    rebuild: bool = False,
    now: datetime | None = None,
    progress: Callable[[int, int], None] = lambda _done, _of: None,
) -> Historied:
    """Return the histories of all machines whose sessions lie in a folder, at most four folders deep.

    A session is read where its session file has another time or size than in the index, and another content than any that is
    known. One that cannot be read is left out and named.

    Args:
        folder: that holds session folders, and models of `calibrate` or `diagnose`.
        asked: how trends are worked out.
        source_files: with error sources of models.
        rebuild: read everything anew.
        now: the time; None: the clock's.
        progress: told how many of how many files are done.

    Raises:
        InputError: there is no session in it, or none that can be used; a test that none of them has.
    """
    found = files_of(folder)
    with Kept(folder, begin_anew=rebuild) as kept:
        reading = _Reading(kept, source_files, progress, len(found.sessions) + len(found.models))
        sessions = [one for name, path in found.sessions.items() if (one := reading.session(name, path)) is not None]
        models = [model for name, path in found.models.items() if (model := reading.model(name, path)) is not None]
        kept.drop_others([*found.sessions, *found.models])
        notes = [kept.problem] if kept.problem else []
    progress(reading.of, reading.of)
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
        raise InputError([Problem(str(folder), 0, 0, what, "`dbbstation check SESSION` names every fault")])
    _check_tests(folder, dated, asked)
    by_session, unlike = _of_one_session(models, dated)
    notes += [*alike, *unlike]
    machines = histories(dated, by_session, asked)
    for machine in machines:
        notes += date_faults(machine.sessions, now or datetime.now(UTC))
        notes += _gathered(machine.sessions)
    return Historied(machines, tuple(left_out), tuple(notes), reading.worked_out)


_Kind = TypeVar("_Kind", SessionFigures, ModelFigures)


class _Reading:
    """Reads sessions and models, from the index where it knows them.

    Attributes:
        of: files in all.
        left_out: name and reason of those that cannot be read.
        worked_out: how many were read.
    """

    def __init__(self, kept: Kept, source_files: Sequence[Path], progress: Callable[[int, int], None], of: int) -> None:
        self.of = of
        self.left_out: list[tuple[str, str]] = []
        self.worked_out = 0
        self._kept = kept
        self._source_files = source_files
        self._progress = progress
        self._done = 0

    def session(self, name: str, path: Path) -> SessionFigures | None:
        """Return the figures of a session; None where it cannot be read."""
        folder = name.removesuffix(f"/{SESSION_FILE}")
        return self._figures(name, folder, path, self._session_data, lambda data: session_from(data, folder))

    def model(self, name: str, path: Path) -> ModelFigures | None:
        """Return the parameters of a model; None where it cannot be read."""
        return self._figures(name, name, path, self._model_data, lambda data: model_from(data, name))

    def _figures(
        self,
        name: str,
        called: str,
        path: Path,
        work: Callable[[Path], dict[str, Any]],
        taken: Callable[[dict[str, Any]], _Kind],
    ) -> _Kind | None:
        self._progress(self._done, self.of)
        self._done += 1
        try:
            stamp = stamp_of(path)
            found = _understood(self._kept.of(name, stamp), taken)
            if found is None:
                digest = hashlib.sha256(path.read_bytes()).hexdigest()
                text = self._kept.of_content(digest)
                found = _understood(text, taken)
                if text is None or found is None:
                    text = self._worked_out(path, digest, work)
                    found = taken(json.loads(text))
                self._kept.keep(name, stamp, digest, text)
        except StationError as error:
            self.left_out.append((called, _first_of(error)))
            return None
        except OSError as error:
            self.left_out.append((called, reason_of(error)))
            return None
        note_known(path, found.sha256)
        return found

    def _worked_out(self, path: Path, digest: str, work: Callable[[Path], dict[str, Any]]) -> str:
        self.worked_out += 1
        return json.dumps({**work(path), "sha256": digest}, allow_nan=False)

    def _session_data(self, path: Path) -> dict[str, Any]:
        from dbbstation.session_figures import session_figures  # noqa: PLC0415 - whoever opens an index does not wait for the compiler

        data = asdict(session_figures(path.parent))
        data["started"] = None if data["started"] is None else data["started"].isoformat()
        return data

    def _model_data(self, path: Path) -> dict[str, Any]:
        from dbbstation.session_figures import model_figures  # noqa: PLC0415 - the same

        return asdict(model_figures(path, self._source_files))


def _understood(text: str | None, taken: Callable[[dict[str, Any]], _Kind]) -> _Kind | None:
    """Return what a kept text says; None where there is none, or where somebody else wrote it."""
    try:
        return None if text is None else taken(json.loads(text))
    except (AttributeError, KeyError, TypeError, ValueError):
        return None


def _first_of(error: StationError) -> str:
    """Return what is wrong on one line; of many faults the first, and how many more there are."""
    lines = str(error).splitlines()
    return lines[0] + (f" (and {len(lines) - 1} more)" if len(lines) > 1 else "")


def session_from(data: dict[str, Any], folder: str) -> SessionFigures:
    """Return a session as the index keeps it, under the name that it has now.

    Raises:
        KeyError, TypeError, ValueError: it is none.
    """
    return SessionFigures(
        name=folder,
        sha256=data["sha256"],
        machine=data["machine"],
        started=None if data["started"] is None else datetime.fromisoformat(data["started"]),
        runs=tuple(
            RunFigures(
                run["test"], run["direction"], run["circle"], tuple(Figure(**figure) for figure in run["figures"])
            )
            for run in data["runs"]
        ),
        bar=data["bar"],
        programs=data["programs"],
        notes=tuple(data["notes"]),
    )


def model_from(data: dict[str, Any], name: str) -> ModelFigures:
    """Return a model as the index keeps it, under the name that it has now; errors as of `session_from`."""
    parameters = tuple(ModelParameter(**parameter) for parameter in data["parameters"])
    return ModelFigures(name, data["sha256"], dict(data["sessions"]), parameters)


MOST_NAMED = 3
"""Sessions that are named where many have the same to be said of them."""


def _gathered(sessions: Sequence[SessionFigures]) -> list[str]:
    """Return what is to be said of sessions, what many have in common once."""
    by_text: dict[str, list[str]] = {}
    for one in sessions:
        for note in one.notes:
            by_text.setdefault(note, []).append(one.name)
    said = []
    for note, names in by_text.items():
        more = len(names) - MOST_NAMED
        said.append(f"{', '.join(names[:MOST_NAMED])}{f' and {more} more' if more > 0 else ''}: {note}")
    return said


def _once(sessions: Iterable[SessionFigures]) -> tuple[list[SessionFigures], list[str]]:
    """Return each session once, and what is said of its copies."""
    first: dict[str, SessionFigures] = {}
    said = []
    for one in sessions:
        before = first.setdefault(one.sha256, one)
        if before is not one:
            said.append(
                f"{one.name} is a copy of {before.name}, by the SHA-256 of its session file: it is counted once"
            )
    return list(first.values()), said


def _check_tests(folder: Path, sessions: Sequence[SessionFigures], asked: Asked) -> None:
    known = {run.test for one in sessions for run in one.runs}
    unknown = [name for name in (*asked.tests, *asked.exclude) if name not in known]
    if unknown:
        what = f"no session has a test {', '.join(unknown)}"
        raise InputError([Problem(str(folder), 0, 0, what, f"tests are {', '.join(sorted(known))}")])


def _of_one_session(
    models: Sequence[ModelFigures], sessions: Sequence[SessionFigures]
) -> tuple[dict[str, ModelFigures], list[str]]:
    """Return the model of each session by the session's hash, and what is said of models that are none's."""
    known = {one.sha256: one.name for one in sessions}
    taken: dict[str, ModelFigures] = {}
    said = []
    for model in sorted(models, key=lambda one: (-len(one.parameters), one.file)):
        if len(model.sessions) != 1:
            said.append(
                f"{model.file} comes from {len(model.sessions)} sessions together: it is no value of one of them"
            )
            continue
        ((name, digest),) = model.sessions.items()
        if digest not in known:
            said.append(f"{model.file} comes from a session {name} that is not here, or was changed since")
        elif taken.setdefault(digest, model) is not model:
            other = taken[digest].file
            said.append(f"{model.file} and {other} are of one session, {known[digest]}: {other} is taken")
    return taken, said
