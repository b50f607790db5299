"""`dbbstation measure`: the whole sequence of a measurement, on a screen or in lines."""

from __future__ import annotations

import math
import sys
import threading
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import click

from dbbstation.cli.declared import made
from dbbstation.cli.instrument_options import OpenLine, RateHz, spying
from dbbstation.cli.output import echo, print_result, say
from dbbstation.cli.session_options import RecordingOptions
from dbbstation.system.ports import SLOWEST
from dbbstation.system.signals import CTRL_C, KILLED_POLITELY, answered, interrupt_on
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from dbbstation.cli.instrument_options import LineOptions
    from dbbstation.instrument.protocol import Protocol
    from dbbstation.plan.plan import Direction, Plan
    from dbbstation.station.assembly import Job, Workplace
    from dbbstation.system.signals import Signals


def at_a_terminal() -> bool:
    """Return whether a screen can be shown and read."""
    return sys.stdin.isatty() and sys.stdout.isatty() and sys.stderr.isatty()


@dataclass(frozen=True)
class Asked:
    """The options of one measurement."""

    line: LineOptions
    noted: RecordingOptions
    plan: Path | None
    machine: Path | None
    out: Path | None
    rate_hz: float | None
    time_scale: float

    @property
    def of_operator(self) -> bool:
        """Return whether `--job` names the job file of an operator."""
        return self.noted.job.endswith((".yaml", ".yml"))

    def require(self) -> None:
        """Refuse missing options.

        Raises:
            click.UsageError: names the missing options.
        """
        needed = {
            "--plan": self.plan,
            "--machine": self.machine,
            "--instrument": self.line.instrument,
            "--port": self.line.port,
            "--out": self.out,
        }
        missing = [name for name, value in needed.items() if not value]
        if missing:
            raise click.UsageError(f"missing {', '.join(missing)}; --virtual on a terminal needs none of them")

    def job(self) -> tuple[Job, Protocol]:
        """Return the job for a machine in real time, and the instrument's protocol. Call `require` first.

        Raises:
            StationError: every fault of the files and of the instrument's name.
            click.UsageError: facts of bar or shop that do not fit together.
        """
        from dbbstation.files.formats.machine import read_machine
        from dbbstation.files.formats.plan import read_inline_plan
        from dbbstation.instrument.library import at_rate
        from dbbstation.station.assembly import Job
        from dbbstation.station.programs import load_programs

        if self.plan is None or self.machine is None or self.out is None:
            raise ValueError("plan, machine and folder are required before a job is made of them")
        nominal, whole = read_machine(self.machine), self.noted.in_force(read_inline_plan(self.plan))
        protocol = at_rate(self.line.protocol(bar_length_mm=self.noted.stated_length_mm()), self.rate_hz)
        programs = self.noted.programs
        job = Job(
            machine=nominal,
            plan=whole,
            folder=self.out,
            details=self.noted.details(protocol.length.stroke_mm),
            programs={} if programs is None else load_programs(programs, whole.to_domain(), nominal),
            model=self.noted.judging_model(),
        )
        return job.read_by(protocol, self.line.profile or "", self.line.port, self.line.baud), protocol


_WAITING_SCALE = 100.0
"""Approximate speed of a waiting machine's time relative to real time."""

_AUTO_PATIENCE_S = 60.0
"""Longest wait for a virtual machine [s of real time]; it starts as soon as it has computed the run."""


@made()
def measure(
    line: OpenLine,
    noted: RecordingOptions,
    *,
    plan: Annotated[Path | None, o.PLAN] = None,
    machine: Annotated[Path | None, o.MACHINE] = None,
    out: Annotated[Path | None, replace(o.OUT, kind="folder", metavar="SESSION")] = None,
    screen: Annotated[bool, Option("Print lines in place of a screen, as without a terminal.")] = True,
    virtual: Annotated[bool, Option("Use a virtual machine and instrument, on the screen.")] = False,
    auto: Annotated[
        str | None,
        Option(
            "Start each circle through this control address of `instrument emulate`, and accept every run.",
            metavar="URL",
        ),
    ] = None,
    time_scale: Annotated[float, Option(o.TIME_SCALE, least=SLOWEST, most=200.0)] = 1.0,
    rate_hz: RateHz = None,
    as_json: o.Json = False,
) -> int:
    r"""Measure a plan, test by test, into a session folder.

    The screen shows what to do, the live reading, the live circle and the first figures. Without options it begins with
    the existing sessions and the choices for a new one. The command waits for Enter, then for the machine, and detects
    start and end of a circle in the readings. Every sample is on the disk within a second. Quitting or Ctrl-C loses no
    data; the same command continues the session. --model judges circles by a model, not by the nominal geometry.

    \b
    Examples:
      dbbstation measure                               choose on the screen what is measured
      dbbstation measure --virtual                     try it without hardware
      dbbstation measure --virtual --time-scale 10     the same, ten times faster
      dbbstation measure --job monday-check.yaml       one job for an operator, by its file
      dbbstation measure --plan table2.yaml --machine machine.yaml --instrument heidenhain-nd281b \
        --port /dev/ttyUSB0 --out 2026-11-20-hexapod-7 --bar bar.yaml
      dbbstation measure ... --order drift --gate first   (heights mixed, the first test again at the end)
      dbbstation measure ... --port /dev/pts/5 --auto tcp://127.0.0.1:41234 --time-scale 50   (against `instrument emulate`)
    """
    asked = Asked(line, noted, plan, machine, out, rate_hz, time_scale)
    if screen and auto is None and not as_json and at_a_terminal():
        from dbbstation.cli.on_screen import on_screen

        return on_screen(asked, virtual=virtual)
    if virtual or asked.of_operator:
        what = "--virtual" if virtual else "a job file"
        raise click.UsageError(f"{what} needs the screen: a terminal, without --no-screen, --auto and --json")
    asked.require()
    _in_lines(asked, auto, as_json=as_json)
    return 0


def _in_lines(asked: Asked, auto: str | None, *, as_json: bool) -> None:
    from dbbstation.instrument.driver import Instrument
    from dbbstation.service.held_line import RECONNECT_S, driver_patience
    from dbbstation.station.assembly import assemble

    job, protocol = asked.job()
    line = asked.line
    hands = None if auto is None else VirtualHands(auto)
    stands_s = -math.inf if hands is None else hands.stands_since_s()
    waits = math.isfinite(stands_s)
    job = _timed(job, asked, protocol, stands_s, machine_is_virtual=auto is not None)
    job.check(str(asked.plan))
    say_sampling(job.plan.to_domain(), protocol, line.baud)
    if job.machine.control is not None:
        echo(f"note: the control corrects by itself: {job.machine.control.said}; the session notes it", err=True)
    if auto is None:  # a virtual machine has a bar of known length
        asked.noted.require_bar(job)
    with (
        spying(asked.noted.spy, protocol, line.port) as log,
        Instrument(
            protocol,
            line.port,
            baud=line.baud,
            clock=job.clock,
            log=log,
            reconnect_s=RECONNECT_S,
            **driver_patience(job.time_scale, waits=waits),
        ) as source,
    ):
        workplace = assemble(job, source, source.unreadable, asked=protocol.ask.asked)
        if workplace.writer.runs and job.details.noted:
            echo("note: the session exists and keeps its operator, bar and other notes", err=True)
        interrupted = _run(workplace, hands, as_json=as_json)
    if interrupted:
        raise click.Abort


def _timed(job: Job, asked: Asked, protocol: Protocol, stands_s: float, *, machine_is_virtual: bool) -> Job:
    """Return the job with the clock of its machine, which stopped to wait at `stands_s` or never waits."""
    from dbbstation.instrument.stamps import MachineTime
    from dbbstation.station.detector import Patience
    from dbbstation.virtual.wire_clock import ScaledClock

    line, time_scale, waits = asked.line, asked.time_scale, math.isfinite(stands_s)
    return replace(
        job,
        patience=Patience(for_machine_s=_AUTO_PATIENCE_S * max(time_scale, 1.0)) if machine_is_virtual else Patience(),
        clock=MachineTime(1.0 / protocol.fastest_hz(line.baud), stands_s) if waits else ScaledClock(time_scale),
        time_scale=_WAITING_SCALE if waits else time_scale,
        # A real machine neither has a control address of `instrument emulate` nor runs faster than it does.
        instrument=job.instrument
        and replace(
            job.instrument,
            port=f"{line.port}, in machine time" if waits else line.port,
            virtual=machine_is_virtual or time_scale != 1.0 or job.instrument.virtual,
        ),
    )


def _run(workplace: Workplace, hands: VirtualHands | None, *, as_json: bool) -> bool:
    from dbbstation.cli.measure_talk import Keyboard, Log, Summary, Talk
    from dbbstation.station.autopilot import Autopilot
    from dbbstation.station.commands import Quit

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

    def stop(number: Signals) -> None:
        interrupt_on(number)
        station.send(Quit())

    try:
        with told_to_stop((CTRL_C, KILLED_POLITELY), stop) as interrupted:
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
def told_to_stop(signals: Sequence[Signals], act: Callable[[Signals], object]) -> Iterator[threading.Event]:
    """Act on signals between samples; yield whether one came."""
    told = threading.Event()

    def stop(number: Signals) -> None:
        told.set()
        act(number)

    with answered(signals, stop):
        yield told


class VirtualHands:
    """Moves the virtual machine of `instrument emulate`.

    Raises:
        MachineError: no such address.
    """

    def __init__(self, url: str) -> None:
        from dbbstation.virtual.control import ControlClient

        self._client = ControlClient(url)

    def standing(self) -> str | None:
        """Return the name of the ball on the virtual table."""
        ball = self._client.ask("status").get("ball")
        return None if ball is None else str(ball)

    def stands_since_s(self) -> float:
        """Return the machine time at which it stopped to wait [s]; minus infinity if it never waits."""
        return float(str(self._client.ask("status").get("stands_since_s", -math.inf)))

    def mount(self, test: str) -> None:
        """Put up the ball of a test."""
        self._client.free()
        self._client.ask("mount", test)

    def start(self, test: str, direction: Direction, program: str) -> None:
        """Start a circle."""
        self._client.free()
        self._client.ask("start", test, direction, *([program] if program else []))


def say_sampling(plan: Plan, protocol: Protocol, baud: int | None) -> None:
    """Print the instrument's readings of the circles."""
    from dbbstation.plan.sampling import sampling_notes

    for note in sampling_notes(plan, protocol.label, protocol.fastest_hz(baud)):
        say(f"note: {note}")
