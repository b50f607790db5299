"""`dbbstation session`: what can be done to a session afterwards."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from dbbstation.files.recordings.session import RunEntry, SessionFolder

_FOLDER = click.argument("folder", type=click.Path(path_type=Path), metavar="FOLDER")
_RUN = click.argument("run", metavar="RUN")
_JSON = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")


@click.group()
def session() -> None:
    """List the runs of a session, accept or reject them afterwards, take in or seal recordings.

    \b
    Examples:
      dbbstation session list 2026-11-20-hexapod-7
      dbbstation session reject 2026-11-20-hexapod-7 a-ccw-2 --reason "chip under the holder"
      dbbstation session accept 2026-11-20-hexapod-7 a-ccw-2
      dbbstation session seal from-the-old-program
    """  # noqa: D301 (click reads the escape)


@session.command("list")
@_FOLDER
@_JSON
def list_runs(folder: Path, *, as_json: bool) -> None:
    """List every run: when it was started, its mounting, its state, and why it was rejected.

    \b
    Examples:
      dbbstation session list 2026-11-20-hexapod-7
      dbbstation session list 2026-11-20-hexapod-7 --json
    """  # noqa: D301 (click reads the escape)
    from dbbstation.cli.output import print_json, print_table
    from dbbstation.files.recordings.session import read_session

    read = read_session(folder)
    missing = [f"{test} {direction}" for test, direction in _missing(read)]
    if as_json:
        runs = [
            {
                "run": _name(run),
                "test": run.test,
                "direction": run.direction.value,
                "repeat": run.repeat,
                "mounting": run.mounting,
                "started": None if run.started is None else run.started.isoformat(),
                "state": run.state.value,
                "reason": run.reason or None,
                "file": run.path.relative_to(read.folder).as_posix(),
            }
            for run in read.runs
        ]
        print_json({"session": read.name, "runs": runs, "missing": missing})
        return
    rows = [
        [
            _name(run),
            "" if run.started is None else run.started.strftime("%Y-%m-%d %H:%M:%S %Z").strip(),
            "" if run.mounting is None else str(run.mounting),
            run.state.value,
            run.reason,
        ]
        for run in read.runs
    ]
    print_table(["run", "started", "mounting", "state", "why"], rows)
    click.echo(f"no accepted run: {', '.join(missing)}" if missing else "every test of the plan has an accepted run")


@session.command()
@_FOLDER
@_RUN
@_JSON
def accept(folder: Path, run: str, *, as_json: bool) -> None:
    """Accept a run that was rejected or not judged, such as a-ccw-2.

    \b
    Examples:
      dbbstation session accept 2026-11-20-hexapod-7 a-ccw-2
    """  # noqa: D301 (click reads the escape)
    _tell(run, _judged(folder, run, accepted=True), as_json=as_json)


@session.command()
@_FOLDER
@_RUN
@click.option("--reason", required=True, help="Why, in a few words; it stands in the session file.")
@_JSON
def reject(folder: Path, run: str, *, reason: str, as_json: bool) -> None:
    """Reject a run, such as a-ccw-2, and note why. Its recording is kept; no command uses it any more.

    \b
    Examples:
      dbbstation session reject 2026-11-20-hexapod-7 a-ccw-2 --reason "chip under the holder"
    """  # noqa: D301 (click reads the escape)
    if not reason.strip():
        raise click.UsageError("say why with --reason: whoever reads the session later will ask")
    _tell(run, _judged(folder, run, accepted=False, reason=reason.strip()), as_json=as_json)


@session.command("take-in")
@_FOLDER
@_JSON
def take_in(folder: Path, *, as_json: bool) -> None:
    """List sealed runs that lie in the session's folder and are in no list.

    `dbbstation check` names them. They may come from a second program that wrote into the folder, or from a session file
    that was restored. They are `complete` then: accept or reject each.

    \b
    Examples:
      dbbstation session take-in 2026-11-20-hexapod-7
      dbbstation session accept 2026-11-20-hexapod-7 a-ccw-2
    """  # noqa: D301 (click reads the escape)
    from dbbstation.cli.output import print_json
    from dbbstation.files.recordings.session import unlisted_sealed
    from dbbstation.files.recordings.session_writer import SessionWriter

    with SessionWriter.open(folder) as writer:
        taken = [_name(writer.take_in(path)) for path in unlisted_sealed(writer.session)]
    if as_json:
        print_json({"session": str(folder), "taken_in": taken})
        return
    for name in taken:
        click.echo(f"{name}: complete, accept or reject it")
    if not taken:
        click.echo("every sealed run is listed already")


@session.command()
@_FOLDER
@click.option("--dry-run", is_flag=True, help="Say which runs would get a hash, and write nothing.")
@_JSON
def seal(folder: Path, *, dry_run: bool, as_json: bool) -> None:
    """Write the hashes of recordings that were made elsewhere into the session file.

    A session file written by hand needs no hashes: this adds one to each run that has none, and leaves everything else
    in the file as it is. From then on a changed recording is noticed.

    \b
    Examples:
      dbbstation session seal from-the-old-program --dry-run
      dbbstation session seal from-the-old-program
    """  # noqa: D301 (click reads the escape)
    from dbbstation.cli.output import print_json
    from dbbstation.files.atomic import write_text
    from dbbstation.files.recordings.sealing import sealing

    found = sealing(folder)
    if found.files and not dry_run:
        write_text(found.path, found.text, force=True, rewrites=True)
    if as_json:
        print_json({"session": str(found.path), "sealed": [] if dry_run else found.files, "without_hash": found.files})
        return
    done = "would be sealed" if dry_run else "sealed"
    for file in found.files:
        click.echo(f"{file}: {done}")
    if not found.files:
        click.echo("every run has a hash already")


def _name(run: RunEntry) -> str:
    return f"{run.test}-{run.direction}-{run.repeat}"


def _tell(name: str, run: RunEntry, *, as_json: bool) -> None:
    """Say what has become of a run."""
    from dbbstation.cli.output import print_json

    if as_json:
        print_json({"run": name, "state": run.state.value, "reason": run.reason or None})
    else:
        click.echo(f"{name}: {run.state.value}" + (f" ({run.reason})" if run.reason else ""))


def _missing(read: SessionFolder) -> list[tuple[str, str]]:
    """Tests and directions of the plan without an accepted run."""
    from dbbstation.files.recordings.session import RunState

    done = {(run.test, run.direction) for run in read.in_state(RunState.ACCEPTED)}
    planned = [(name, direction) for name, test in read.plan.tests.items() for direction in test.directions]
    return [(name, direction.value) for name, direction in planned if (name, direction) not in done]


def _judged(folder: Path, run: str, *, accepted: bool, reason: str = "") -> RunEntry:
    """Find a run by its name and note what became of it.

    Raises:
        InputError: faults of the session, or no such run in it.
        OutputError: another process writes into the session.
    """
    import difflib

    from dbbstation.errors import InputError, Problem
    from dbbstation.files.recordings.session import read_session
    from dbbstation.files.recordings.session_writer import SessionWriter

    names = [_name(entry) for entry in read_session(folder).runs]
    if run not in names:
        near = difflib.get_close_matches(run, names, n=1, cutoff=0.6)
        remedy = f"did you mean {near[0]}?" if near else "`dbbstation session list` names them"
        raise InputError([Problem(str(folder), 0, 0, f"the session has no run {run}", remedy)])
    with SessionWriter.open(folder) as writer:
        entry = next(entry for entry in writer.runs if _name(entry) == run)
        return writer.judge(entry, accepted=accepted, reason=reason)
