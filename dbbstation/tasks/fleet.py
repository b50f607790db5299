"""Run one task once on each of many sessions, on this computer or by a Dask scheduler."""

from __future__ import annotations

import json
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from dbbstation.errors import OutputError, StationError
from dbbstation.facts import of_facts
from dbbstation.facts.serialise import read_plain
from dbbstation.files.atomic import streamed, write_bytes
from dbbstation.files.csv_rows import table_csv
from dbbstation.files.fleet_folder import FleetFolder
from dbbstation.files.formats.session import starts_of
from dbbstation.files.gateway import digest_of
from dbbstation.files.inputs import input_book, note_known
from dbbstation.files.keys import files_of_session, key_of, program_identity
from dbbstation.files.places import SESSION_FILE, real_path, text_of_name
from dbbstation.files.provenance import from_python, write_table
from dbbstation.files.recordings.former import files_of, reason_of
from dbbstation.files.recordings.session import read_session
from dbbstation.report.fleet_page import fleet_html
from dbbstation.results.fleet import TABLE, FleetFound, FleetResult, FleetSession, StoredFiles
from dbbstation.sisters.unlike import FALSE_ALARMS
from dbbstation.tasks.declare import paths_of
from dbbstation.tasks.executors import Ended, WorkPool
from dbbstation.tasks.export import FORMATS
from dbbstation.tasks.exporting import pyarrow_for
from dbbstation.tasks.fleet_compare import Sister, compared
from dbbstation.tasks.fleet_work import TASKS, FleetOptions, FleetPiece, Worked, worked
from dbbstation.tasks.telling import Telling, never, silent
from dbbstation.text.written import natural

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from dbbstation.files.provenance import Provenance
    from dbbstation.files.recordings.session import SessionFolder
    from dbbstation.results.fleet import State
    from dbbstation.tasks.load import Sessions
    from dbbstation.tasks.telling import Progress


_NUMBERS = frozenset({"value", "u", "usual", "scatter", "score", "smallest_seen"})
_WHOLE = frozenset({"sisters"})
_YES_OR_NO = frozenset({"unlike"})


def write_fleet_table(path: Path, result: FleetResult, provenance: Provenance, *, force: bool = False) -> None:
    """Write each value of a fleet as one row.

    Raises:
        OutputError: another extension; the file exists without `force`; pyarrow is missing.
    """
    rows = result.rows()
    if path.suffix.lower() == FORMATS[0]:
        columns = [[_cell(row[name]) for row in rows] for name in TABLE]
        write_table(path, table_csv(TABLE, columns), provenance, force=force)
        return
    if path.suffix.lower() != FORMATS[1]:
        raise OutputError("a table is written as .csv or .parquet", where=str(path), remedy="name such a file")
    pa, parquet = pyarrow_for(path)
    kinds = dict.fromkeys(TABLE, pa.string()) | dict.fromkeys(_NUMBERS, pa.float64())
    kinds |= dict.fromkeys(_WHOLE, pa.int64()) | dict.fromkeys(_YES_OR_NO, pa.bool_())
    told = {"dbbstation": json.dumps(provenance.data(), ensure_ascii=False)}
    arrays = [pa.array([row[name] for row in rows], type=kinds[name]) for name in TABLE]
    table = pa.Table.from_arrays(arrays, schema=pa.schema(list(kinds.items()), metadata=told))
    with streamed(path, force=force) as file:
        parquet.write_table(table, file)


def _cell(value: object) -> object:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "" if value is None else value


WORKING = "sessions"
"""Name of the stage that works on sessions."""

DEFAULT_FOLDER = "fleet"

AS_USUAL = FleetOptions()
"""Default options of every task."""


@dataclass(frozen=True, eq=False)
class _Named:
    """A session of the fleet.

    Attributes:
        inputs: SHA-256 of files that decide its result.
        apart: whether it counts as a separate machine if it has no serial number.
    """

    name: str
    folder: Path
    session: SessionFolder | None = None
    inputs: Mapping[str, str] | None = None
    problem: str = ""
    apart: bool = False

    @property
    def machine(self) -> str:
        """Return the serial number, else the name in the machine's file; add the session if it counts as a separate machine."""
        if self.session is None or self.session.serial_number:
            return "" if self.session is None else self.session.serial_number
        return f"{self.session.machine.name} ({self.name})" if self.apart else self.session.machine.name

    @property
    def started(self) -> str | None:
        """Return the earliest noted start of a run."""
        moments = () if self.session is None else starts_of(self.session.runs)
        return min(moments).isoformat() if moments else None


@dataclass(frozen=True)
class _Outcome:
    session: FleetSession
    found: FleetFound | None


def fleet(
    folders: Sessions,
    task: str,
    out: str | Path = DEFAULT_FOLDER,
    *,
    options: FleetOptions = AS_USUAL,
    processes: int = 1,
    scheduler: str = "",
    false_alarms: float = FALSE_ALARMS,
    apart: bool = False,
    anew: bool = False,
    provenance: Callable[[], Provenance] = from_python,
    progress: Progress = silent,
    stop: Callable[[], bool] = never,
    say: Callable[[str], None] = silent,
) -> FleetResult:
    """Run one task on every session of some folders and compare the machines.

    Args:
        folders: of sessions, at most four levels deep, or sessions.
        task: `calibrate`, `circles`, `diagnose` or `report`.
        scheduler: address of a Dask scheduler; empty for none.
        false_alarms: probability of any unlike value if all machines are alike.
        apart: sessions without serial number are different machines; else equal names mean one machine.
        anew: ignore kept results.

    Raises:
        InputError: a folder holds no session.
        OutputError: the results' folder holds something else, or cannot be written.
        SchedulerError: no such scheduler, or its workers have another program.
        StoppedError: `stop` returned True; finished results are kept.
    """
    if task not in TASKS:
        raise StationError(f"there is no task {task!r} for a fleet", remedy=f"it is one of {', '.join(TASKS)}")
    telling = Telling(progress, stop, say)
    with FleetFolder(Path(out), task) as kept:
        with input_book():
            named = [replace(one, apart=apart) for one in _once(_sessions(paths_of(folders), telling), telling)]
            extra = {str(path): digest_of(path) for path in options.source_files}
        program = program_identity()
        about = {"task": task, "options": _plain(options), "sources": list(extra.values())}
        keys = {
            place: key_of({**about, "name": one.folder.name}, [(Path(p).name, d) for p, d in one.inputs.items()])
            for place, one in enumerate(named)
            if one.inputs is not None
        }
        outcomes: dict[int, _Outcome] = {}
        todo = []
        for place, one in enumerate(named):
            if one.problem:
                outcomes[place] = _outcome(one, "failed", problem=one.problem)
                say(f"failed: {one.name}: {one.problem}")
            elif not anew and (data := kept.known(one.name, keys[place])) is not None:
                outcomes[place] = _known(one, kept, data, fresh=False)
            else:
                todo.append(place)
        pieces = [
            FleetPiece(task, real_path(named[place].folder), options, {**(named[place].inputs or {}), **extra}, program)
            for place in todo
        ]
        workplace: WorkPool[FleetPiece, Worked] = WorkPool(min(processes, len(pieces)), scheduler)
        telling.stage(WORKING, 0, len(pieces))
        with closing(workplace.each(worked, pieces)) as results:
            for done, (at, outcome) in enumerate(results, start=1):
                place = todo[at]
                outcomes[place] = _taken(named[place], kept, keys[place], outcome)
                if outcomes[place].found is None:
                    say(f"failed: {named[place].name}: {outcomes[place].session.problem}")
                telling.stage(WORKING, done, len(pieces))
        notes = _without_number(named)
        for note in notes:
            say(note)
        result = _result(task, kept, named, [outcomes[place] for place in range(len(named))], false_alarms, notes)
        for one in named:
            if one.session is not None:
                note_known(one.folder / SESSION_FILE, one.session.sha256)
        write_fleet_table(kept.table, result, provenance(), force=True)
        write_bytes(kept.page, fleet_html(result, provenance()), force=True)
        return result


def _sessions(folders: Sequence[Path], telling: Telling) -> Iterator[_Named]:
    for folder in folders:
        if (folder / SESSION_FILE).is_file() or folder.name == SESSION_FILE:
            place = folder.parent if folder.name == SESSION_FILE else folder
            yield _read(real_path(place).name, place)
            continue
        found = files_of(folder)
        for name, why in found.closed:
            telling.note(f"{name}: {why}")
        named = {name.removesuffix(f"/{SESSION_FILE}"): path.parent for name, path in found.sessions.items()}
        for name in sorted(named, key=natural):
            yield _read(name, named[name])


def _read(name: str, folder: Path) -> _Named:
    name = text_of_name(name)
    try:
        session = read_session(folder)
        inputs = {str(real_path(path)): digest_of(path) for path in dict.fromkeys(files_of_session(session))}
    except OSError as error:
        return _Named(name, folder, problem=reason_of(error))
    except StationError as error:
        return _Named(name, folder, problem=str(error))
    return _Named(name, folder, session, inputs)


def _once(sessions: Iterator[_Named], telling: Telling) -> list[_Named]:
    first: dict[str, _Named] = {}
    names: dict[str, int] = {}
    kept = []
    for one in sessions:
        mark = str(real_path(one.folder)) if one.session is None else one.session.sha256
        before = first.setdefault(mark, one)
        if before is not one:
            if real_path(before.folder) != real_path(one.folder):
                telling.note(
                    f"{one.name} is a copy of {before.name}, by the SHA-256 of its session file: it is done once"
                )
            continue
        names[one.name] = names.get(one.name, 0) + 1
        kept.append(replace(one, name=f"{one.name} ({names[one.name]})") if names[one.name] > 1 else one)
    return kept


def _plain(options: FleetOptions) -> dict[str, object]:
    settings = options.settings
    return {
        **options.given,
        "tolerances": [asdict(one) for one in settings.tolerances],
        "from": settings.tolerances_from,
    }


def _taken(one: _Named, kept: FleetFolder, key: str, result: Worked | Ended) -> _Outcome:
    if isinstance(result, Ended) or result.problem:
        return _outcome(one, "failed", problem=result.problem)
    data = {"session": one.name, "machine": one.machine, **result.found, "result": result.result}
    return _known(one, kept, kept.keep(one.name, key, data, result.files), fresh=True)


def _known(one: _Named, kept: FleetFolder, data: dict[str, object], *, fresh: bool) -> _Outcome:
    found, stored = read_plain(FleetFound, data), read_plain(StoredFiles, data)
    files = (kept.file_of(one.name, stored.key), *stored.files)
    return _outcome(one, "done" if fresh else "up-to-date", found, files=files)


def _outcome(
    one: _Named, state: State, found: FleetFound | None = None, *, problem: str = "", files: tuple[str, ...] = ()
) -> _Outcome:
    told = found or FleetFound((), (), "", ())
    further = {"session": one.name, "state": state, "problem": problem, "files": files, "compared": False}
    return _Outcome(of_facts(FleetSession, told, one, **further), found)


def _without_number(named: Sequence[_Named]) -> tuple[str, ...]:
    of_name: dict[str, list[_Named]] = {}
    for one in named:
        if one.session is not None and not one.session.serial_number:
            of_name.setdefault(one.session.machine.name, []).append(one)
    return tuple(
        f"{len(several)} sessions of {name} have no serial number: each is counted as a machine of its own"
        if several[0].apart
        else f"{len(several)} sessions of {name} have no serial number: they are counted as one machine, and the last of them is compared; "
        "--apart counts each as a machine of its own"
        for name, several in of_name.items()
        if len(several) > 1
    )


def _result(
    task: str,
    kept: FleetFolder,
    named: Sequence[_Named],
    outcomes: Sequence[_Outcome],
    false_alarms: float,
    notes: tuple[str, ...],
) -> FleetResult:
    last: dict[str, int] = {}
    for place, outcome in enumerate(outcomes):
        if outcome.found is None:
            continue
        before = last.setdefault(outcome.session.machine, place)
        if (outcome.session.started or "") >= (outcomes[before].session.started or ""):
            last[outcome.session.machine] = place
    chosen = sorted(last.values())
    sessions = tuple(replace(outcome.session, compared=place in set(chosen)) for place, outcome in enumerate(outcomes))
    sisters = [
        Sister(named[place].machine, named[place].name, session.machine, found)
        for place in chosen
        if (session := named[place].session) is not None and (found := outcomes[place].found) is not None
    ]
    has_values = any(sister.found.values for sister in sisters)
    return FleetResult(
        task=task,
        folder=str(kept.folder),
        table=str(kept.table),
        page=str(kept.page),
        sessions=sessions,
        notes=notes,
        comparison=compared(sisters, false_alarms) if has_values else None,
    )
