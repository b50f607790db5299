"""The options of `measure`."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from dbbstation.system.ports import is_virtual

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.cli.instrument_options import LineOptions
    from dbbstation.cli.session_options import RecordingOptions
    from dbbstation.files.formats.session import ReadBy
    from dbbstation.instrument.protocol import Protocol
    from dbbstation.station.assembly import Job


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
            rate_hz=protocol.fastest_hz(self.line.baud),
            range_mm=protocol.length.range_mm,
            model=self.noted.judging_model(),
            instrument=self.read_by(protocol),
        )
        return job, protocol

    def read_by(self, protocol: Protocol) -> ReadBy:
        """Return the session's note on the instrument."""
        from dbbstation.files.formats.session import ReadBy

        return ReadBy(protocol.name, self.line.profile or "", self.line.port, is_virtual(self.line.port))
