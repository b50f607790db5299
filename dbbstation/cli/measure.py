"""`dbbstation measure`: the whole sequence of a measurement without a screen."""

from __future__ import annotations

import math
import threading
from contextlib import contextmanager
from dataclasses import dataclass
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
from dbbstation.service.patience import RECONNECT_S, driver_patience
from dbbstation.system.signals import CTRL_C, KILLED_POLITELY, answered, interrupt_on
from dbbstation.system.virtual_ports import is_virtual

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dbbstation.plan.circle import Direction
    from dbbstation.station.assembly import Workplace
    from dbbstation.station.engine import Station
    from dbbstation.system.signals import Signals

_WAITING_SCALE = 100.0
"""About so much faster than real time passes the time of a machine that waits."""

_AUTO_PATIENCE_S = 60.0
"""A virtual machine comes as soon as it has computed the run, or not at all [s of real time]."""


@click.command()
@click.option("--plan", "plan_file", required=True, type=click.Path(path_type=Path), help="Test plan.")
@click.option("--machine", "machine_file", required=True, type=click.Path(path_type=Path), help="Nominal machine.")
@instrument_options(required=True)
@click.option("--out", required=True, type=click.Path(path_type=Path, file_okay=False), help="Session folder.")
@click.option(
    "--auto", metavar="URL", help="Start each circle at this control address of `instrument emulate`, accept every run."
)
@click.option(
    "--time-scale",
    type=Finite(0.01, 200.0),
    default=1.0,
    show_default=True,
    help="The same factor as of `instrument emulate`.",
)
@click.option(
    "--rate-hz",
    type=Finite(0.1, 100000.0),
    help="Sampling rate [1/s], if it is not the usual one.",
)
@programs_option
@spy_option
@loss_option
@judging_model_options
@order_options
@session_options
@click.option("--json", "as_json", is_flag=True, help="Print what was recorded as JSON.")
def measure(**given: Any) -> None:  # noqa: ANN401 - the options, each with a type of its own
    r"""Measure a plan, test by test, into a session folder.

    Tells you which ball goes into which bore and how to tilt the tool. It waits for Enter, then for the machine: it
    detects start and end of a circle in the readings. Every sample is on the disk within a second. Ctrl-C stops the
    measurement; the same command continues it.

    \b
    Examples:
      dbbstation measure --plan table2.yaml --machine machine.yaml --instrument heidenhain-nd281b \
        --port /dev/ttyUSB0 --out 2026-11-20-hexapod-7 --bar bar.yaml
      dbbstation measure ... --order drift --gate first   (heights in turn, the first test again at the end)
      dbbstation measure ... --port /dev/pts/5 --auto tcp://127.0.0.1:41234 --time-scale 50   (against `instrument emulate`)
    """
    noted = taken_from(given, SessionOptions)
    _measured(MeasureOptions(**given, session=noted))


@dataclass(frozen=True, kw_only=True)
class MeasureOptions:
    """The options of `measure`.

    Attributes:
        zero_mm: None: the bar's length.
        auto: control address of `instrument emulate`; None: a person starts circles.
        largest_loss_percent: of a run's samples; None: the plan's.
        largest_bar_age_h: None: any.
        model_file: None: the nominal machine.
    """

    plan_file: Path
    machine_file: Path
    instrument: str
    profile: str | None
    zero_mm: float | None
    port: str
    baud: int | None
    spy: Path | None
    out: Path
    auto: str | None
    time_scale: float
    programs: Path | None
    rate_hz: float | None
    largest_loss_percent: float | None
    largest_bar_age_h: float | None
    model_file: Path | None
    source_files: tuple[Path, ...]
    order: str
    gate: str
    as_json: bool
    session: SessionOptions


def _measured(asked: MeasureOptions) -> None:
    from dbbstation.files.formats.machine import read_machine
    from dbbstation.files.formats.plan import read_inline_plan
    from dbbstation.files.recordings.entries import ReadBy
    from dbbstation.instrument.driver import Instrument
    from dbbstation.instrument.library import at_rate
    from dbbstation.instrument.stamps import MachineTime
    from dbbstation.station.assembly import Job, assemble
    from dbbstation.station.detector import Patience
    from dbbstation.station.programs import load_programs
    from dbbstation.virtual.wire_clock import ScaledClock

    machine = read_machine(asked.machine_file)
    plan = in_order(
        with_loss_limit(read_inline_plan(asked.plan_file), asked.largest_loss_percent), asked.order, asked.gate
    )
    chosen = chosen_protocol(
        asked.instrument, asked.profile, asked.zero_mm, bar_length_mm=asked.session.stated_length_mm()
    )
    protocol = at_rate(chosen, asked.rate_hz)
    hands = None if asked.auto is None else VirtualHands(asked.auto)
    stands_s = -math.inf if hands is None else hands.stands_since_s()
    waits = math.isfinite(stands_s)
    time_scale = _WAITING_SCALE if waits else asked.time_scale
    clock = MachineTime(1.0 / protocol.fastest_hz(asked.baud), stands_s) if waits else ScaledClock(time_scale)
    job = Job(
        machine=machine,
        plan=plan,
        folder=asked.out,
        details=asked.session.details(protocol.length.stroke_mm),
        programs={} if asked.programs is None else load_programs(asked.programs, plan.to_domain(), machine),
        patience=Patience()
        if asked.auto is None
        else Patience(for_machine_s=_AUTO_PATIENCE_S * max(asked.time_scale, 1.0)),
        clock=clock,
        time_scale=time_scale,
        rate_hz=protocol.fastest_hz(asked.baud),
        range_mm=protocol.length.range_mm,
        model=judging_model(asked.model_file, asked.source_files),
        # A real machine neither has a control address of `instrument emulate` nor runs faster than it does.
        instrument=ReadBy(
            chosen.name,
            asked.profile or "",
            f"{asked.port}, in machine time" if waits else asked.port,
            virtual=asked.auto is not None or asked.time_scale != 1.0 or is_virtual(asked.port),
        ),
    )
    job.check(str(asked.plan_file))
    say_sampling(plan.to_domain(), protocol, asked.baud)
    if machine.control is not None:
        echo(f"note: the control corrects by itself: {machine.control.said}; the session notes it", err=True)
    if asked.auto is None:  # a virtual machine has a bar of known length
        require_bar(job, asked.largest_bar_age_h)
    with (
        spying(asked.spy, protocol, asked.port) as log,
        Instrument(
            protocol,
            asked.port,
            baud=asked.baud,
            clock=clock,
            log=log,
            reconnect_s=RECONNECT_S,
            **driver_patience(time_scale, waits=waits),
        ) as source,
    ):
        workplace = assemble(job, source, source.unreadable, asked=protocol.ask.asked)
        if workplace.writer.runs and job.details.noted:
            echo("note: the session exists; it keeps operator, bar and the like as first noted", err=True)
        interrupted = _run(workplace, hands, as_json=asked.as_json)
    if interrupted:
        raise click.Abort


def _run(workplace: Workplace, hands: VirtualHands | None, *, as_json: bool) -> bool:
    from dbbstation.cli.measure_talk import Keyboard, Log, Summary, Talk
    from dbbstation.cli.output import print_result
    from dbbstation.station.autopilot import Autopilot

    station, summary, talk = workplace.station, Summary(), Talk(asking=hands is None)
    station.subscribe(summary)
    station.subscribe(Log())
    station.subscribe(talk)
    if hands is not None:
        station.subscribe(Autopilot(station.send, hands))
    else:
        keyboard = Keyboard(station.send)
        station.subscribe(keyboard)
        keyboard.start()
    try:
        with _interruptible(station) as interrupted:
            station.run()
    finally:
        talk.end()
        workplace.close()
        if as_json:
            print_result(summary.of(workplace))
        else:
            done, planned = workplace.schedule.accepted, len(workplace.schedule.tasks)
            echo(f"{workplace.writer.session.folder}: {done} of {planned} runs accepted")
    return interrupted.is_set()


@contextmanager
def _interruptible(station: Station) -> Iterator[threading.Event]:
    """End the sequence between samples on Ctrl-C or SIGTERM; a second signal aborts."""
    from dbbstation.station.commands import Quit

    interrupted = threading.Event()

    def stop(number: Signals) -> None:
        interrupted.set()
        interrupt_on(number)
        station.send(Quit())

    with answered((CTRL_C, KILLED_POLITELY), stop):
        yield interrupted


class VirtualHands:
    """Moves the virtual machine of `instrument emulate`.

    Raises:
        MachineError: no such address.
    """

    def __init__(self, url: str) -> None:
        from dbbstation.virtual.control_client import ControlClient

        self._client = ControlClient(url)

    def standing(self) -> str | None:
        """Return the name of the ball that stands on the virtual table."""
        ball = self._client.ask("status").get("ball")
        return None if ball is None else str(ball)

    def stands_since_s(self) -> float:
        """Return the machine time since which it stands [s]; minus infinity if it does not wait."""
        return float(str(self._client.ask("status").get("stands_since_s", -math.inf)))

    def mount(self, test: str) -> None:
        """Put up the ball of a test."""
        self._client.free()
        self._client.ask("mount", test)

    def start(self, test: str, direction: Direction, program: str) -> None:
        """Start a circle."""
        self._client.free()
        self._client.ask("start", test, direction, *([program] if program else []))
