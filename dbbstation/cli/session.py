"""`dbbstation session`: list and change a recorded session."""

from __future__ import annotations

from collections import Counter
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import click

from dbbstation.cli.declared import Answer, made
from dbbstation.cli.output import echo, print_table
from dbbstation.errors import InputError
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option
from dbbstation.text.written import repeats_in_order

if TYPE_CHECKING:
    from dbbstation.files.recordings.session import SessionFolder

_Folder = Annotated[Path, Option("of the session.", kind="argument", metavar="FOLDER")]
_Run = Annotated[str, Option("of the session.", kind="argument-text", metavar="RUN")]
_Reason = Annotated[str, Option("Reason, for the session file.")]


@click.group()
def session() -> None:
    r"""List the runs of a session, accept or reject them afterwards, add or seal recordings, change a plan on purpose.

    \b
    Examples:
      dbbstation session list 2026-11-20-hexapod-7
      dbbstation session reject 2026-11-20-hexapod-7 a-cw-2 --reason "chip under the holder"
      dbbstation session accept 2026-11-20-hexapod-7 a-cw-2
      dbbstation session seal recorded-elsewhere
      dbbstation session log 2026-11-20-hexapod-7
    """


@made("list", session)
def list_runs(folder: _Folder) -> Answer:
    r"""List every run: when it was started, its mounting, its state, its samples (received, lost, rejected), and why it was rejected.

    \b
    Examples:
      dbbstation session list 2026-11-20-hexapod-7
      dbbstation session list 2026-11-20-hexapod-7 --json
    """
    from dbbstation.facts import of_facts
    from dbbstation.files.recordings.session import read_session
    from dbbstation.results.sessions import ListedRun, ListedSession

    read = read_session(folder)
    missing, runs = _missing(read), repeats_in_order(read.runs)
    listed = tuple(
        of_facts(
            ListedRun,
            run,
            run=run.name,
            direction=run.direction.value,
            started=None if run.started is None else run.started.isoformat(),
            state=run.state.value,
            reason=run.reason or None,
            file=run.path.relative_to(read.folder).as_posix(),
        )
        for run in runs
    )
    rows = [
        [
            run.name,
            _at(run.started),
            run.mounting,
            run.state.value,
            run.counts and run.counts.text,
            run.reason,
        ]
        for run in runs
    ]

    def words() -> None:
        print_table("run, started, mounting, state, samples, why", rows)
        for circle, count in Counter(f"{run.test} {run.direction}" for run in read.accepted).items():
            if count > 1:
                echo(f"{circle} has {count} accepted runs: all of them count")
        echo(f"no accepted run: {', '.join(missing)}" if missing else "every test of the plan has an accepted run")

    return Answer(ListedSession(read.name, read.virtual, listed, tuple(missing)), words)


@made(group=session)
def accept(
    folder: _Folder,
    run: _Run,
    *,
    reason: _Reason = "",
) -> Answer:
    r"""Accept a run that was rejected or not judged, such as a-cw-2.

    A run that lost more samples than the plan allows, or whose recording shows no circle, needs a reason. On a terminal
    the command asks for the reason.

    \b
    Examples:
      dbbstation session accept 2026-11-20-hexapod-7 a-cw-2
      dbbstation session accept 2026-11-20-hexapod-7 a-cw-2 --reason "lost samples lie before the turn"
    """
    return _judged(folder, run, accepted=True, reason=reason.strip())


@made(group=session)
def reject(folder: _Folder, run: _Run, *, reason: _Reason) -> Answer:
    r"""Reject a run, such as a-cw-2, and note why. The recording is kept, but no command uses it any more.

    \b
    Examples:
      dbbstation session reject 2026-11-20-hexapod-7 a-cw-2 --reason "chip under the holder"
    """
    return _judged(folder, run, accepted=False, reason=_stated(reason))


@made("take-in", session)
def take_in(folder: _Folder) -> Answer:
    r"""Add runs to the session's list: sealed recordings in its folder that the list lacks.

    `dbbstation check` names such runs. A second program may have recorded them, or an old session file may have been
    restored. Their state becomes `complete`: accept or reject each run.

    \b
    Examples:
      dbbstation session take-in 2026-11-20-hexapod-7
      dbbstation session accept 2026-11-20-hexapod-7 a-cw-2
    """
    from dbbstation.files.recordings.lock import PATIENCE_S
    from dbbstation.files.recordings.session import unlisted_sealed
    from dbbstation.files.recordings.session_writer import SessionWriter

    with SessionWriter.open(folder, PATIENCE_S) as writer:
        taken = [writer.take_in(path).name for path in unlisted_sealed(writer.session)]
    words = [f"{name}: complete, accept or reject it" for name in taken]
    return Answer({"session": str(folder), "taken_in": taken}, words or ["the session lists every sealed run already"])


@made(group=session)
def amend(
    folder: _Folder,
    *,
    reason: _Reason,
    plan: Annotated[Path | None, o.PLAN] = None,
    machine: Annotated[Path | None, o.MACHINE] = None,
) -> Answer:
    r"""Change sealed files of a session on purpose, and note the reason.

    Plan and machine are sealed when a session is made. Every command refuses a session whose sealed files were changed
    without a note. `amend` accepts the session as it is, or with another plan or machine. The folder `sealed` keeps the
    former file. The session file states what was changed, when and why, with both hashes; `dbbstation check` shows
    this. The command also accepts a list of runs that was changed by hand.

    \b
    Examples:
      dbbstation session amend 2026-11-20-hexapod-7 --reason "joint 3 measured again" --machine measured.yaml
      dbbstation session amend 2026-11-20-hexapod-7 --reason "ball 4-short was 0.1 mm off in the sheet"
    """
    from dbbstation.files.recordings.amending import amend as noted

    reason, now = _stated(reason), datetime.now(UTC).replace(microsecond=0)
    found = noted(folder, reason, made=now, plan=plan, machine=machine)
    changed = [
        {"what": one.what, "former_sha256": one.former_sha256, "sha256": one.sha256, "former": one.former or None}
        for one in found
    ]
    words = [f"{one.what}: amended" + (f", as it was: {one.former}" if one.former else "") for one in found]
    return Answer({"session": str(folder), "reason": reason, "changed": changed}, words)


@made(group=session)
def seal(
    folder: _Folder,
    *,
    dry_run: o.DryRun = False,
) -> Answer:
    r"""Seal a session that was recorded elsewhere.

    A session file written by hand needs no hashes. `seal` adds missing hashes of runs, machine, plan and jig, and a
    chain through all runs. The rest of the file stays unchanged. The folder `sealed` gets copies of machine, plan and
    jig. Every command then notices a changed recording or plan, and a removed or exchanged run.

    \b
    Examples:
      dbbstation session seal recorded-elsewhere --dry-run
      dbbstation session seal recorded-elsewhere
    """
    from dbbstation.files.recordings.sealing import seal_session, sealing

    found = sealing(folder)
    if found.anything and not dry_run:
        found = seal_session(folder)
    told = {"without_hash": found.files, "linked": found.linked, "files": dict(found.seal.files)}
    done = "would be sealed" if dry_run else "sealed"
    whole = f"{len(found.seal.files)} files and {found.seal.runs} runs: {done}"
    words = [f"{file}: {done}" for file in found.files]
    return Answer(
        {"session": str(found.path), "sealed": [] if dry_run else found.files, **told},
        [*words, whole if found.anything else "every run and file is sealed already"],
    )


@made(group=session)
def log(folder: _Folder) -> Answer:
    r"""List what happened in a session: runs, verdicts with their reasons, notes, amendments, each with its time and hash.

    The last line is the anchor of the session. Note it elsewhere: `dbbstation check --anchor` then reports later
    changes of these events.

    \b
    Examples:
      dbbstation session log 2026-11-20-hexapod-7
      dbbstation session log 2026-11-20-hexapod-7 --json
    """
    from dbbstation.files.recordings.event_log import keys_told, read_event_log, runs_told
    from dbbstation.files.recordings.session import read_session
    from dbbstation.results.sessions import ListedEvent, SessionEvents

    read = read_session(folder)
    found = read_event_log(read.folder, [])
    events = () if found is None else found.events
    told = [runs_told(event) or ", ".join(keys_told(event)) for event in events]
    listed = tuple(
        ListedEvent(number, None if one.at is None else one.at.isoformat(), one.what, about, one.link)
        for number, (one, about) in enumerate(zip(events, told, strict=True), start=1)
    )

    def words() -> None:
        if events:
            rows = [[k, _at(one.at), one.what, told[k - 1]] for k, one in enumerate(events, start=1)]
            print_table("event, at, what, about", rows)
        echo(f"anchor {events[-1].link}" if events else "no event log; `dbbstation session seal` begins one")

    return Answer(SessionEvents(read.name, listed, events[-1].link if events else None), words)


@made(group=session)
def rebuild(folder: _Folder) -> Answer:
    r"""Write the session file again from the event log.

    Use it for a session file that was damaged, lost or edited by mistake. The folder `sealed` keeps the present file.
    The recordings stay unchanged.

    \b
    Examples:
      dbbstation session rebuild 2026-11-20-hexapod-7
    """
    from dbbstation.files.recordings.amending import rebuild as written

    former, events = written(folder)
    kept = f"; as it was: {former}" if former else ""
    told = {"session": str(folder), "events": events, "former": former or None}
    return Answer(told, [f"session file written from {events} events{kept}"])


def _stated(reason: str) -> str:
    if not reason.strip():
        raise click.UsageError("give the reason with --reason, for later readers of the session")
    return reason.strip()


def _at(moment: datetime | None) -> str:
    return "" if moment is None else moment.strftime("%Y-%m-%d %H:%M:%S %Z").strip()


def _missing(read: SessionFolder) -> list[str]:
    done = {(run.test, run.direction) for run in read.accepted}
    return [f"{name} {direction}" for name, direction in read.plan.runs() if (name, direction) not in done]


def _judged(folder: Path, run: str, *, accepted: bool, reason: str) -> Answer:
    import difflib

    from dbbstation.files.formats.session import RunState
    from dbbstation.files.recordings.lock import PATIENCE_S
    from dbbstation.files.recordings.session_writer import SessionWriter

    with SessionWriter.open(folder, PATIENCE_S) as writer:
        entries = {entry.name: entry for entry in writer.runs}
        if run not in entries:
            near = difflib.get_close_matches(run, entries, n=1, cutoff=0.6)
            remedy = f"did you mean {near[0]}?" if near else "`dbbstation session list` names them"
            raise InputError.of(folder, f"the session has no run {run}", remedy)
        entry = entries[run]
        if accepted and not reason and entry.state is not RunState.RECORDING:
            reason = _reason_for(run, writer.session.unusable(entry))
        judged = writer.judge(entry, accepted=accepted, reason=reason)
    words = f"{run}: {judged.state.value}" + (f" ({judged.reason})" if judged.reason else "")
    return Answer({"run": run, "state": judged.state.value, "reason": judged.reason or None}, [words])


def _reason_for(run: str, unusable: str) -> str:
    """Ask for the reason to accept an unusable run; empty for a usable run."""
    from dbbstation.cli.asking import Asker

    if not unusable:
        return ""
    asker = Asker()
    if not asker.terminal:
        raise click.UsageError(f"{run}: {unusable}\ngive the reason with --reason, for later readers of the session")
    echo(f"{run}: {unusable}", err=True)
    while True:
        answer = asker.text("why is it to be accepted", "--reason").strip()
        if answer:
            return answer
