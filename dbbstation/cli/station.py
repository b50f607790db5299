"""`dbbstation station`: the terminal screen."""

from __future__ import annotations

import sys
import tempfile
import threading
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dbbstation.cli.instrument_options import chosen_protocol, instrument_options, spy_option, spying
from dbbstation.cli.judging_model import judging_model, judging_model_options
from dbbstation.cli.loss import loss_option, with_loss_limit
from dbbstation.cli.number_types import Finite
from dbbstation.cli.option_object import taken_from
from dbbstation.cli.order_options import in_order, order_options, programs_option
from dbbstation.cli.output import echo
from dbbstation.cli.sampling import say_sampling
from dbbstation.cli.session_options import SessionOptions, require_bar, session_options
from dbbstation.cli.shop import SETTINGS_OPTION, from_settings
from dbbstation.files.formats.virtual_port import FASTEST, SLOWEST, virtual_port
from dbbstation.system.hang_up import ended_when_hung_up
from dbbstation.system.signals import CLOSED, KILLED_POLITELY, answered
from dbbstation.system.virtual_ports import is_virtual

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.service.choice import Choice, Limits
    from dbbstation.service.held_line import HeldLine
    from dbbstation.service.memory import Line
    from dbbstation.service.runner import Opener
    from dbbstation.station.assembly import Job
    from dbbstation.station.events import Observer
    from dbbstation.system.signals import Signals
    from dbbstation.tui.app import StationApp

_DEMO = {"plan": "protocols/plans/ten-minute-check.yaml", "machine": "fixtures/machines/reference.yaml"}
_DEMO_INSTRUMENT = "streaming-encoder"
_DEMO_SEED = 3


@click.command()
@click.option("--plan", "plan_file", type=click.Path(path_type=Path), help="Test plan.")
@click.option("--machine", "machine_file", type=click.Path(path_type=Path), help="Nominal machine.")
@instrument_options(required=False)
@click.option(
    "--out", type=click.Path(path_type=Path, file_okay=False), help="Session folder. An existing session is continued."
)
@click.option("--virtual", is_flag=True, help="Use a virtual machine and instrument.")
@click.option(
    "--time-scale",
    type=Finite(SLOWEST, FASTEST),
    default=1.0,
    show_default=True,
    help="Factor by which the virtual machine runs faster than real time, with --virtual.",
)
@spy_option
@loss_option
@judging_model_options
@order_options
@programs_option
@session_options
def station(
    *,
    plan_file: Path | None,
    machine_file: Path | None,
    instrument: str | None,
    profile: str | None,
    zero_mm: float | None,
    port: str | None,
    baud: int | None,
    spy: Path | None,
    out: Path | None,
    virtual: bool,
    time_scale: float,
    largest_loss_percent: float | None,
    largest_bar_age_h: float | None,
    model_file: Path | None,
    source_files: tuple[Path, ...],
    order: str,
    gate: str,
    programs: Path | None,
    **told: Any,  # noqa: ANN401 - the session's options, each with a type of its own
) -> int:
    r"""Measure a plan on a screen: what to do, the live reading, the live circle, the first figures.

    Without options it begins with the existing sessions and the choices for a new one. Records what `dbbstation measure`
    records. Quitting loses nothing; the same command continues the session.

    \b
    Examples:
      dbbstation station                               choose on the screen what is measured
      dbbstation station --virtual                     try it without hardware
      dbbstation station --virtual --time-scale 10     the same, ten times faster
      dbbstation station --job monday-check.yaml       one job for an operator, by its file
      dbbstation station --plan table2.yaml --machine machine.yaml --instrument heidenhain-nd281b \
        --port /dev/ttyUSB0 --out 2026-11-20-hexapod-7 --bar bar.yaml
    """
    noted = taken_from(told, SessionOptions)
    if noted.job.endswith((".yaml", ".yml")):
        if virtual or any(given is not None for given in (plan_file, machine_file, out)):
            raise click.UsageError("a job says what is measured: leave out --plan, --machine, --out and --virtual")
        _check_terminal()
        return _operate(Path(noted.job), judging_model(model_file, source_files))
    # The shop's instrument stands elsewhere: a virtual one brings its own line.
    port = None if virtual and from_settings("port") else port
    baud = None if virtual and from_settings("baud") else baud
    if not virtual and time_scale == 1.0 and plan_file is None and machine_file is None and out is None:
        _check_terminal()
        return _begin(
            replace(
                _given(_line(instrument, profile, port, baud, zero_mm), spy, (order, gate), noted), programs=programs
            ),
            _limits(largest_loss_percent, largest_bar_age_h),
            judging_model(model_file, source_files),
        )
    _check_options(
        virtual=virtual, time_scale=time_scale, baud=baud, needed=(plan_file, machine_file, instrument, port, out)
    )
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

    plan_file = plan_file or demo("plan")
    machine = read_machine(machine_file or demo("machine"))
    plan = in_order(with_loss_limit(read_inline_plan(plan_file), largest_loss_percent), order, gate)
    name = instrument or _DEMO_INSTRUMENT
    protocol = chosen_protocol(name, profile, zero_mm, bar_length_mm=noted.stated_length_mm())
    details = noted.details(protocol.length.stroke_mm)
    folder = out or Path(tempfile.mkdtemp(prefix="dbbstation-")) / "session"
    with ExitStack() as stack:
        job = Job(
            machine,
            plan,
            folder,
            details,
            {} if programs is None else load_programs(programs, plan.to_domain(), machine),
            rate_hz=protocol.fastest_hz(baud),
            range_mm=protocol.length.range_mm,
            model=judging_model(model_file, source_files),
            instrument=ReadBy(
                protocol.name,
                profile or "",
                virtual_port(time_scale) if virtual else str(port),
                virtual or is_virtual(str(port)),
            ),
        )
        job.check(str(plan_file))
        if (folder / SESSION_FILE).is_file():
            check_not_mixed(folder, read_session(folder), job.instrument)
        if not virtual:
            require_bar(job, largest_bar_age_h)
        helper = None
        if virtual:
            from dbbstation.service.virtual_place import virtual_place

            echo("switching on the virtual machine …", err=True)
            place = stack.enter_context(
                virtual_place(
                    machine,
                    plan.to_domain(),
                    protocol,
                    time_scale=time_scale,
                    seed=_DEMO_SEED,
                    programs=job.programs,
                )
            )
            job, port, helper = replace(job, clock=place.clock, time_scale=time_scale), place.port, place.helper
        say_sampling(plan.to_domain(), protocol, baud)
        log = stack.enter_context(spying(spy, protocol, str(port)))
        observers: list[Observer] = [Log(), *([] if helper is None else [helper])]
        line = HeldLine(protocol, str(port), baud, clock=job.clock, time_scale=time_scale, log=log)
        stack.callback(line.close)
        return _run(job, opener(job, line, observers=observers), line)


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
        raise click.UsageError("--time-scale goes with --virtual: real machines take their time")


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


def _line(
    instrument: str | None, profile: str | None, port: str | None, baud: int | None, zero_mm: float | None
) -> Line:
    from dbbstation.service.memory import Line

    return Line(instrument=instrument or "", profile=profile or "", port=port or "", baud=baud, zero_mm=zero_mm)


def _given(line: Line, spy: Path | None, sequence: tuple[str, str], noted: SessionOptions) -> Choice:
    from dbbstation.service.choice import Choice
    from dbbstation.service.order import Gate, Order

    lost = ["spy"] if spy is not None else []
    lost += noted.of_bar
    if lost:
        names = ", ".join(f"--{name.replace('_', '-')}" for name in lost)
        raise click.UsageError(f"{names} goes with --plan, --machine, --instrument, --port and --out")
    return Choice(
        line=line,
        bar=noted.bar_file,
        bar_waiver=noted.bar_waiver.strip(),
        operator=noted.operator,
        serial_number=noted.serial_number,
        job=noted.job,
        order=Order(sequence[0]),
        gate=Gate(sequence[1]),
        ambient_temp_c=noted.ambient_temp_c,
    )


def _limits(largest_loss_percent: float | None, largest_bar_age_h: float | None) -> Limits:
    from dbbstation.service.choice import Limits
    from dbbstation.station.bar_known import USUAL_AGE_H

    over_plan = not from_settings("largest_loss_percent")
    return Limits(largest_bar_age_h or USUAL_AGE_H, largest_loss_percent, over_plan)


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
