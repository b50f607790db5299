"""`dbbstation measure` on the terminal screen."""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dbbstation.cli.instrument_options import spying
from dbbstation.cli.measure import say_sampling, told_to_stop
from dbbstation.cli.output import echo
from dbbstation.cli.shop import SETTINGS_OPTION, from_settings
from dbbstation.facts import of_facts
from dbbstation.files.places import SESSION_FILE, shipped_folder
from dbbstation.system.ports import FASTEST, virtual_port
from dbbstation.system.signals import CLOSED, KILLED_POLITELY, ended_when_hung_up

if TYPE_CHECKING:
    from dbbstation.cli.measure import Asked
    from dbbstation.cli.session_options import RecordingOptions
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.service.choice import Choice, Limits
    from dbbstation.station.events import Observer
    from dbbstation.tui.app import StationApp

_DEMO = {"plan": "protocols/plans/ten-minute-check.yaml", "machine": "fixtures/machines/reference.yaml"}
_DEMO_INSTRUMENT = "streaming-encoder"


def on_screen(asked: Asked, *, virtual: bool) -> int:
    """Measure on the screen, and return the exit code.

    Raises:
        click.UsageError: options that do not go together.
        StationError: as `Asked.job`.
    """
    noted = asked.noted
    stated = any(given is not None for given in (asked.plan, asked.machine, asked.out))
    if asked.of_operator:
        if virtual or stated:
            raise click.UsageError(
                "the job file states what is measured: leave out --plan, --machine, --out and --virtual"
            )
        return _operate(Path(noted.job), noted.judging_model())
    if not virtual and asked.time_scale == 1.0 and not stated:
        return _begin(_given(asked), _limits(noted), noted.judging_model())
    if virtual:
        asked = _with_virtual(asked)
    else:
        asked.require()
        if asked.time_scale != 1.0:
            raise click.UsageError("--time-scale goes with --virtual or --auto: a real machine has its own speed")
    return _measured(asked, virtual=virtual)


def _with_virtual(asked: Asked) -> Asked:
    """Return the job on a virtual machine, which brings its own line."""
    line = replace(
        asked.line,
        instrument=asked.line.instrument or _DEMO_INSTRUMENT,
        port="" if from_settings("port") else asked.line.port,
        baud=None if from_settings("baud") else asked.line.baud,
    )
    if line.port or line.baud is not None:
        raise click.UsageError("--virtual brings its own instrument: leave out --port and --baud")
    if asked.time_scale > FASTEST:
        raise click.UsageError(f"--virtual goes with a --time-scale of at most {FASTEST:g}")
    return replace(
        asked,
        line=replace(line, port=virtual_port(asked.time_scale)),
        plan=asked.plan or _shipped("plan"),
        machine=asked.machine or _shipped("machine"),
        out=asked.out or Path(tempfile.mkdtemp(prefix="dbbstation-")) / "session",
    )


def _shipped(what: str) -> Path:
    folder, _, rest = _DEMO[what].partition("/")
    return shipped_folder(folder) / rest


def _measured(asked: Asked, *, virtual: bool) -> int:
    from dbbstation.cli.measure_talk import Log
    from dbbstation.files.recordings.session import read_session
    from dbbstation.service.held_line import HeldLine
    from dbbstation.service.runner import Runner, opener
    from dbbstation.station.opening import check_not_mixed
    from dbbstation.tui.app import StationApp
    from dbbstation.tui.board_screen import Shown

    job, protocol = asked.job()
    port = asked.line.port
    job.check(str(asked.plan))
    if (job.folder / SESSION_FILE).is_file():
        check_not_mixed(job.folder, read_session(job.folder), job.instrument)
    if not virtual:
        asked.noted.require_bar(job)
    observers: list[Observer] = [Log()]
    with ExitStack() as stack:
        if virtual:
            from dbbstation.service.virtual_place import virtual_place

            echo("switching on the virtual machine …", err=True)
            place = stack.enter_context(virtual_place(job, protocol, asked.time_scale))
            job, port = place.job, place.port
            observers.append(place.helper)
        say_sampling(job.plan.to_domain(), protocol, asked.line.baud)
        log = stack.enter_context(spying(asked.noted.spy, protocol, port))
        held = HeldLine(protocol, port, asked.line.baud, clock=job.clock, time_scale=asked.time_scale, log=log)
        stack.callback(held.close)
        shown = Shown(job.plan.name, job.plan.plate.bores, tests=job.plan.to_domain().tests)
        return _shown(StationApp(shown, Runner(opener(job, held, observers=observers), held)))


def _begin(given: Choice, limits: Limits, model: IdentifiedModel | None) -> int:
    from dbbstation.cli.measure_talk import Log
    from dbbstation.service.front import Front
    from dbbstation.service.memory import Memory
    from dbbstation.tui.app import StationApp

    named = click.get_current_context().find_root().params.get(SETTINGS_OPTION)
    front = Front(
        Path.cwd(), Memory(), limits, [Log()], model, given, None if named is None else Path(named).absolute()
    )
    return _shown(StationApp(None, None, front=front))


def _operate(path: Path, model: IdentifiedModel | None) -> int:
    from dbbstation.cli.measure_talk import Log
    from dbbstation.service.front import Front
    from dbbstation.service.memory import Memory
    from dbbstation.service.operated import read_operated
    from dbbstation.tui.app import StationApp

    operated = read_operated(path)
    front = Front(operated.sessions, Memory(), observers=[Log()], model=model)
    return _shown(StationApp(None, None, front=front, operated=operated))


def _given(asked: Asked) -> Choice:
    from dbbstation.service.choice import Choice, Gate, Order
    from dbbstation.service.memory import Line

    line, noted = asked.line, asked.noted
    lost = [name for name, given in (("spy", noted.spy), ("rate_hz", asked.rate_hz)) if given is not None]
    lost += noted.of_bar
    if lost:
        names = ", ".join(f"--{name.replace('_', '-')}" for name in lost)
        raise click.UsageError(f"{names} goes with --plan, --machine, --instrument, --port and --out")
    return of_facts(
        Choice,
        noted,
        line=Line(**asdict(line) | {"profile": line.profile or ""}),
        bar_waiver=noted.bar_waiver.strip(),
        order=Order(noted.order),
        gate=Gate(noted.gate),
    )


def _limits(noted: RecordingOptions) -> Limits:
    from dbbstation.service.choice import Limits
    from dbbstation.station.bar_known import USUAL_AGE_H

    over_plan = not from_settings("largest_loss_percent")
    return Limits(noted.largest_bar_age_h or USUAL_AGE_H, noted.largest_loss_percent, over_plan)


def _shown(app: StationApp) -> int:
    with (
        told_to_stop((KILLED_POLITELY, *CLOSED), lambda _number: app.close_down()) as stopped,
        ended_when_hung_up(app.give_up),
    ):
        app.run()
    if app.crash is not None:
        raise app.crash
    if app.board.tasks:
        echo(f"{app.board.session}: {app.board.accepted} of {len(app.board.tasks)} runs accepted", err=True)
    if app.board.fault is not None:
        raise app.board.fault.error
    if stopped.is_set():
        raise click.Abort
    return app.return_code or 0
