"""`dbbstation station`: the terminal screen."""

from __future__ import annotations

import sys
import tempfile
import threading
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import click

from dbbstation.cli.declared import made
from dbbstation.cli.instrument_options import LineOptions, OpenLine, spying
from dbbstation.cli.output import echo
from dbbstation.cli.sampling import say_sampling
from dbbstation.cli.session_options import RecordingOptions
from dbbstation.cli.shop import SETTINGS_OPTION, from_settings
from dbbstation.files.formats.virtual_port import FASTEST, SLOWEST, virtual_port
from dbbstation.system.hang_up import ended_when_hung_up
from dbbstation.system.signals import CLOSED, KILLED_POLITELY, answered
from dbbstation.system.virtual_ports import is_virtual
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.service.choice import Choice, Limits
    from dbbstation.service.held_line import HeldLine
    from dbbstation.service.runner import Opener
    from dbbstation.station.assembly import Job
    from dbbstation.station.events import Observer
    from dbbstation.system.signals import Signals
    from dbbstation.tui.app import StationApp

_DEMO = {"plan": "protocols/plans/ten-minute-check.yaml", "machine": "fixtures/machines/reference.yaml"}
_DEMO_INSTRUMENT = "streaming-encoder"
_DEMO_SEED = 3


@made()
def station(
    line: OpenLine,
    noted: RecordingOptions,
    *,
    plan: Annotated[Path | None, o.PLAN] = None,
    machine: Annotated[Path | None, o.MACHINE] = None,
    out: Annotated[Path | None, replace(o.OUT, kind="folder", metavar="SESSION")] = None,
    virtual: Annotated[bool, Option("Use a virtual machine and instrument.")] = False,
    time_scale: Annotated[
        float,
        Option(
            o.TIME_SCALE,
            least=SLOWEST,
            most=FASTEST,
        ),
    ] = 1.0,
) -> int:
    r"""Measure a plan on a screen: what to do, the live reading, the live circle, the first figures.

    Without options the screen begins with the existing sessions and the choices for a new one. The recorded files are
    the same as with `dbbstation measure`. Quitting loses no data; the same command continues the session.

    \b
    Examples:
      dbbstation station                               choose on the screen what is measured
      dbbstation station --virtual                     try it without hardware
      dbbstation station --virtual --time-scale 10     the same, ten times faster
      dbbstation station --job monday-check.yaml       one job for an operator, by its file
      dbbstation station --plan table2.yaml --machine machine.yaml --instrument heidenhain-nd281b \
        --port /dev/ttyUSB0 --out 2026-11-20-hexapod-7 --bar bar.yaml
    """
    if noted.job.endswith((".yaml", ".yml")):
        if virtual or any(given is not None for given in (plan, machine, out)):
            raise click.UsageError(
                "the job file states what is measured: leave out --plan, --machine, --out and --virtual"
            )
        _check_terminal()
        return _operate(Path(noted.job), noted.judging_model())
    # The shop's instrument stands elsewhere: a virtual one brings its own line.
    if virtual:
        line = replace(
            line,
            port="" if from_settings("port") else line.port,
            baud=None if from_settings("baud") else line.baud,
        )
    if not virtual and time_scale == 1.0 and plan is None and machine is None and out is None:
        _check_terminal()
        return _begin(_given(line, noted), _limits(noted), noted.judging_model())
    needed = (plan, machine, line.instrument or None, line.port or None, out)
    _check_options(virtual=virtual, time_scale=time_scale, baud=line.baud, needed=needed)
    _check_terminal()
    from dbbstation.cli.measure_talk import Log
    from dbbstation.files.formats.machine import read_machine
    from dbbstation.files.formats.plan import read_inline_plan
    from dbbstation.files.recordings.entries import ReadBy
    from dbbstation.files.recordings.session import SESSION_FILE, read_session
    from dbbstation.files.shipped import shipped_folder
    from dbbstation.service.held_line import HeldLine
    from dbbstation.service.opening import opener
    from dbbstation.station.assembly import Job
    from dbbstation.station.opening import check_not_mixed
    from dbbstation.station.programs import load_programs

    def demo(what: str) -> Path:
        folder, _, rest = _DEMO[what].partition("/")
        return shipped_folder(folder) / rest

    plan = plan or demo("plan")
    nominal, whole = read_machine(machine or demo("machine")), noted.in_force(read_inline_plan(plan))
    line = replace(line, instrument=line.instrument or _DEMO_INSTRUMENT)
    protocol = line.protocol(bar_length_mm=noted.stated_length_mm())
    details = noted.details(protocol.length.stroke_mm)
    folder = out or Path(tempfile.mkdtemp(prefix="dbbstation-")) / "session"
    with ExitStack() as stack:
        job = Job(
            nominal,
            whole,
            folder,
            details,
            {} if noted.programs is None else load_programs(noted.programs, whole.to_domain(), nominal),
            rate_hz=protocol.fastest_hz(line.baud),
            range_mm=protocol.length.range_mm,
            model=noted.judging_model(),
            instrument=ReadBy(
                protocol.name,
                line.profile or "",
                virtual_port(time_scale) if virtual else line.port,
                virtual or is_virtual(line.port),
            ),
        )
        job.check(str(plan))
        if (folder / SESSION_FILE).is_file():
            check_not_mixed(folder, read_session(folder), job.instrument)
        if not virtual:
            noted.require_bar(job)
        observers: list[Observer] = [Log()]
        if virtual:
            from dbbstation.service.virtual_place import virtual_place

            echo("switching on the virtual machine …", err=True)
            place = stack.enter_context(
                virtual_place(
                    nominal,
                    whole.to_domain(),
                    protocol,
                    time_scale=time_scale,
                    seed=_DEMO_SEED,
                    programs=job.programs,
                )
            )
            job, line = replace(job, clock=place.clock, time_scale=time_scale), replace(line, port=place.port)
            observers.append(place.helper)
        say_sampling(whole.to_domain(), protocol, line.baud)
        log = stack.enter_context(spying(noted.spy, protocol, line.port))
        held = HeldLine(protocol, line.port, line.baud, clock=job.clock, time_scale=time_scale, log=log)
        stack.callback(held.close)
        return _run(job, opener(job, held, observers=observers), held)


def _check_options(
    *, virtual: bool, time_scale: float, baud: int | None, needed: tuple[Path | str | None, ...]
) -> None:
    names = ("--plan", "--machine", "--instrument", "--port", "--out")
    if virtual and (needed[3] is not None or baud is not None):
        raise click.UsageError("--virtual brings its own instrument: leave out --port and --baud")
    missing = [name for name, value in zip(names, needed, strict=True) if value is None]
    if not virtual and missing:
        raise click.UsageError(f"missing {', '.join(missing)}; or --virtual, to try it without hardware")
    if not virtual and time_scale != 1.0:
        raise click.UsageError("--time-scale goes with --virtual: a real machine has its own speed")


def _check_terminal() -> None:
    if not (sys.stdin.isatty() and sys.stdout.isatty() and sys.stderr.isatty()):
        raise click.UsageError("the screen needs a terminal; `dbbstation measure` does the same without one")


def _run(job: Job, open_station: Opener, line: HeldLine) -> int:
    from dbbstation.service.runner import Runner
    from dbbstation.tui.app import StationApp
    from dbbstation.tui.shown import Shown

    runner = Runner(open_station, line)
    shown = Shown(job.plan.plan.name, job.plan.jig.bores, tests=job.plan.to_domain().tests)
    return _shown(StationApp(shown, runner))


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


def _given(line: LineOptions, noted: RecordingOptions) -> Choice:
    from dbbstation.service.choice import Choice
    from dbbstation.service.memory import Line
    from dbbstation.service.order import Gate, Order

    lost = ["spy"] if noted.spy is not None else []
    lost += noted.of_bar
    if lost:
        names = ", ".join(f"--{name.replace('_', '-')}" for name in lost)
        raise click.UsageError(f"{names} goes with --plan, --machine, --instrument, --port and --out")
    return Choice(
        line=Line(**asdict(line) | {"profile": line.profile or ""}),
        bar=noted.bar,
        bar_waiver=noted.bar_waiver.strip(),
        operator=noted.operator,
        serial_number=noted.serial_number,
        job=noted.job,
        order=Order(noted.order),
        gate=Gate(noted.gate),
        ambient_temp_c=noted.ambient_temp_c,
        programs=noted.programs,
    )


def _limits(noted: RecordingOptions) -> Limits:
    from dbbstation.service.choice import Limits
    from dbbstation.station.bar_known import USUAL_AGE_H

    over_plan = not from_settings("largest_loss_percent")
    return Limits(noted.largest_bar_age_h or USUAL_AGE_H, noted.largest_loss_percent, over_plan)


def _shown(app: StationApp) -> int:
    with _stopped_politely(app) as stopped, ended_when_hung_up(app.give_up):
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


@contextmanager
def _stopped_politely(app: StationApp) -> Iterator[threading.Event]:
    """End the sequence between samples on SIGTERM or SIGHUP, and restore the terminal.

    Yields:
        Whether that happened.
    """
    stopped = threading.Event()

    def stop(_number: Signals) -> None:
        stopped.set()
        app.close_down()

    with answered((KILLED_POLITELY, *CLOSED), stop):
        yield stopped
