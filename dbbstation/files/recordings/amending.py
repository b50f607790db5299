"""Change sealed files deliberately: the former file is kept, and the session notes the change."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dbbstation.errors import InputError, Problem
from dbbstation.files.atomic import set_read_only, write_bytes, write_folder
from dbbstation.files.formats.machine import machine_text, read_machine
from dbbstation.files.formats.plan import plan_text, read_inline_plan
from dbbstation.files.formats.session import Amendment
from dbbstation.files.gateway import sha256_hex
from dbbstation.files.places import SESSION_FILE
from dbbstation.files.recordings.event_log import EVENTS_FILE, read_event_log
from dbbstation.files.recordings.lock import PATIENCE_S, SessionLock
from dbbstation.files.recordings.seal import (
    RUNS,
    chain_faults,
    chained,
    copy_name,
    hash_in,
    hashes,
    is_copy,
    keep_copies,
    sealed_names,
    sealed_over,
)
from dbbstation.files.recordings.session import parse_session, read_session
from dbbstation.files.recordings.session_state import Stands, session_data, standing, text_of
from dbbstation.files.recordings.session_store import SessionStore, marked

if TYPE_CHECKING:
    from datetime import datetime
    from pathlib import Path

    from dbbstation.files.formats.session import RunEntry, Seal
    from dbbstation.files.recordings.session import SessionFolder


def amend(
    folder: Path, reason: str, *, made: datetime, plan: Path | None = None, machine: Path | None = None
) -> tuple[Amendment, ...]:
    """Accept a session as it is, or with another plan or machine, and note the reason.

    Args:
        plan: replaces the session's plan, with its jig inline; None: unchanged.

    Returns:
        What was changed.

    Raises:
        InputError: no session, faults of the new files, runs missing in the new plan, no seal, or no change.
        OutputError: another process writes into the session, or the disk refuses.
    """
    _whole(folder, plan, machine)  # no lock is left in what is no session
    with SessionLock(folder, PATIENCE_S):
        store = SessionStore(folder, lambda: made)
        session, seal = _whole(folder, plan, machine)
        named = dict(zip((machine, plan), session.names, strict=True))
        new = {}
        if machine is not None:
            new[named[machine]] = machine_text(read_machine(machine)).encode()
        if plan is not None:
            new[named[plan]] = plan_text(read_inline_plan(plan)).encode()
        keep_copies(folder, hashes(folder, [*new, *seal.files]))
        now = hashes(folder, sealed_names(folder, session.names))
        now |= {name: sha256_hex(content) for name, content in new.items()}
        if plan is not None:
            now = {name: now[name] for name in session.names}  # the jig is in the plan
        found = [
            Amendment(name, seal.files.get(name, ""), now.get(name, ""), _kept(folder, name, seal), reason, made)
            for name in dict.fromkeys((*seal.files, *now))
            if seal.files.get(name) != now.get(name)
        ]
        runs = session.runs
        if next(chain_faults(folder, seal, runs), None) is not None:
            runs = chained([replace(run, chain_sha256="") for run in runs])
            former = _copied(folder, SESSION_FILE, session.sha256)
            found.append(Amendment(RUNS, seal.chain_sha256, _last_link(runs), former, reason, made))
        found += _logged_otherwise(folder, store, session, reason, made)
        if not found:
            what = "nothing differs from what was sealed"
            raise InputError.of(folder, what, "give --plan or --machine, or change the file first")
        details = replace(session, seal=sealed_over(now, runs), amendments=(*session.amendments, *found))
        for name, content in new.items():
            write_bytes(folder / copy_name(name, now[name]), content, force=True, rewrites=True)
            set_read_only(folder / copy_name(name, now[name]))
            write_bytes(folder / name, content, force=True, rewrites=True)
        keep_copies(folder, now)
        store.write(session_data(folder, session.names, details, runs), "amended")
    return tuple(found)


def _logged_otherwise(
    folder: Path, store: SessionStore, session: SessionFolder, reason: str, made: datetime
) -> list[Amendment]:
    log = read_event_log(folder, [])
    stands = standing(store.data, log)
    if stands.stands is not Stands.UNLIKE:
        return []
    if not stands.log_sound:
        # The chain cannot go on from a log that is not what it was: another begins.
        former_sha256 = "" if log is None else hash_in(folder, EVENTS_FILE)
        former = _copied(folder, EVENTS_FILE, former_sha256) if former_sha256 else ""
        store.begin_anew()
        return [Amendment(EVENTS_FILE, former_sha256, "", former, reason, made)]
    text = text_of(marked(store.log.state(), store.log)).encode()
    name = copy_name(SESSION_FILE, sha256_hex(text))
    write_folder(folder, {name: text}, force=True, own=True, read_only=is_copy)
    store.state = store.log.state()
    return [Amendment(SESSION_FILE, sha256_hex(text), session.sha256, name, reason, made)]


def _copied(folder: Path, name: str, sha256: str) -> str:
    keep_copies(folder, {name: sha256})
    return copy_name(name, sha256)


def _whole(folder: Path, plan: Path | None, machine: Path | None) -> tuple[SessionFolder, Seal]:
    faults: list[Problem] = []
    instead = {key: path for key, path in (("plan", plan), ("machine", machine)) if path is not None}
    session = parse_session(folder, faults, as_sealed=False, instead=instead)
    if session is None or faults:
        raise InputError(faults)
    if session.seal is None:
        what = "the session carries no seal: there is nothing to be amended"
        raise InputError.of(folder, what, f"`dbbstation session seal {folder}` seals it as it is")
    return session, session.seal


def _kept(folder: Path, name: str, seal: Seal) -> str:
    """Return the path of a sealed file's former copy; empty without one."""
    stored = seal.files.get(name, "")
    copy = copy_name(name, stored)
    return copy if stored and hash_in(folder, copy) == stored else ""


def _last_link(runs: tuple[RunEntry, ...]) -> str:
    return next((run.chain_sha256 for run in reversed(runs) if run.chain_sha256), "")


def rebuild(folder: Path) -> tuple[str, int]:
    """Write the session file from the log; the former one is kept.

    Raises:
        InputError: there is no log, or it does not fit the session's files.
        OutputError: another process writes into the session, or the disk refuses.
    """
    faults: list[Problem] = []
    log = read_event_log(folder, faults)
    if log is None or not log.events:
        what = f"there is no {EVENTS_FILE} from which the session file could be written"
        raise InputError(faults or [Problem.of(folder, what, "restore the session file from a backup")])
    with SessionLock(folder, PATIENCE_S):
        store = SessionStore(folder, anew=True)
        read_session(folder)
    return store.put_aside or "", len(store.log.events)
