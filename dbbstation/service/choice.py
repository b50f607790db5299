"""The choice of a measurement, its order and missing parts, and the checked job."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import StrEnum
from typing import TYPE_CHECKING

from dbbstation.files.formats.bar import read_bar
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.formats.session import ReadBy, SessionDetails
from dbbstation.files.places import SESSION_FILE
from dbbstation.files.recordings.session import read_session
from dbbstation.plan.order import LARGEST_LEAK, against_drift, by_holder, height_and_drift, mountings
from dbbstation.plan.plan import circles_s
from dbbstation.service.memory import Line
from dbbstation.station.assembly import Job
from dbbstation.station.bar_known import USUAL_AGE_H, check_bar_known
from dbbstation.station.opening import check_not_mixed
from dbbstation.station.programs import load_programs
from dbbstation.station.schedule import Schedule

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.files.formats.plan import PlanFile
    from dbbstation.files.formats.session import RunEntry
    from dbbstation.instrument.protocol import Protocol
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.plan.plan import Circle, Direction
    from dbbstation.station.programs import RunProgram


class Order(StrEnum):
    """The order."""

    PLAN = "plan"
    """As the plan has the tests."""
    HOLDER = "holder"
    """By holder and ball, each put up once."""
    DRIFT = "drift"
    """Mixed heights, so that a drift does not look like an effect of height."""


class Gate(StrEnum):
    """Tests repeated at the end, which show the drift."""

    PLAN = "plan"
    """The tests that the plan names in `repeat_at_end`."""
    FIRST = "first"
    """The first test."""
    HOLDERS = "holders"
    """The first test of each holder."""


def ordered(plan: PlanFile, order: Order, gate: Gate = Gate.PLAN) -> PlanFile:
    """Return the plan with ordered tests."""
    domain = plan.to_domain()
    choose = {Order.PLAN: lambda one: tuple(one.tests), Order.HOLDER: by_holder, Order.DRIFT: against_drift}
    names = choose[order](domain)
    tests = {test.name: test for test in plan.tests}
    first_of: dict[str, str] = {}
    for name in names:
        first_of.setdefault(domain.tests[name].ball.holder, name)
    gates = {Gate.PLAN: (), Gate.FIRST: names[:1], Gate.HOLDERS: tuple(first_of.values())}
    again = plan.repeat_at_end or gates[gate]
    return plan.model_copy(update={"tests": tuple(tests[name] for name in names), "repeat_at_end": again})


def with_loss(plan: PlanFile, percent: float | None, *, over_plan: bool) -> PlanFile:
    """Return the plan with a limit of lost samples, if it states none or `over_plan`."""
    if percent is None or (plan.largest_loss_percent is not None and not over_plan):
        return plan
    return plan.model_copy(update={"largest_loss_percent": percent})


PROGRAMS = "programs"
"""Folder of a session that contains its NC programs."""


class SetUpPart(StrEnum):
    """Choices for a new session."""

    MACHINE = "machine"
    PLAN = "plan"
    INSTRUMENT = "instrument"
    PORT = "port"
    FOLDER = "folder"
    BAR = "bar"
    PROGRAMS = "NC programs"
    OPERATOR = "operator"
    SERIAL_NUMBER = "serial number"
    JOB = "job"
    TEMPERATURE = "temperature"
    ORDER = "order of tests"
    GATE = "drift gate"


@dataclass(frozen=True)
class Limits:
    """The shop's limits.

    Attributes:
        largest_bar_age_h: beyond which a calibration is stale.
        largest_loss_percent: of a run's samples; None: the plan's.
    """

    largest_bar_age_h: float = USUAL_AGE_H
    largest_loss_percent: float | None = None
    loss_over_plan: bool = False


@dataclass(frozen=True)
class Choice:
    """The choices for a session to make or continue.

    Attributes:
        machine: nominal; None: not chosen, or the session's own.
        bar_waiver: reason for no bar file; may be empty.
        programs: folder; None: plain nominal circles.
        ambient_temp_c: present temperature; None: not read. An existing session gets a note.
    """

    folder: Path | None = None
    machine: Path | None = None
    plan: Path | None = None
    line: Line = field(default_factory=Line)
    bar: Path | None = None
    bar_waiver: str = ""
    programs: Path | None = None
    operator: str = ""
    serial_number: str = ""
    job: str = ""
    ambient_temp_c: float | None = None
    order: Order = Order.PLAN
    gate: Gate = Gate.PLAN

    @property
    def goes_on(self) -> bool:
        """Return whether the session exists."""
        return self.folder is not None and (self.folder / SESSION_FILE).is_file()

    def missing(self) -> tuple[SetUpPart, ...]:
        """Return missing choices in asking order."""
        given = {
            SetUpPart.MACHINE: self.goes_on or self.machine is not None,
            SetUpPart.PLAN: self.goes_on or self.plan is not None,
            SetUpPart.INSTRUMENT: bool(self.line.instrument),
            SetUpPart.PORT: bool(self.line.port),
            SetUpPart.BAR: self.goes_on or self.line.virtual or self.bar is not None or bool(self.bar_waiver),
            SetUpPart.FOLDER: self.folder is not None,
        }
        return tuple(part for part, there in given.items() if not there)


@dataclass(frozen=True, eq=False)
class Prepared:
    """A choice whose files were read and checked.

    Attributes:
        height_and_drift: correlation of test height with a steady drift, 0 to 1.
    """

    job: Job
    protocol: Protocol
    line: Line
    runs: int
    circles_s: float
    mountings: int
    first: Circle | None
    height_and_drift: float

    @property
    def mixes_drift(self) -> bool:
        """Return whether drift could look like an effect of height."""
        return self.height_and_drift > LARGEST_LEAK


def prepare(choice: Choice, limits: Limits | None = None, model: IdentifiedModel | None = None) -> Prepared:
    """Read the choice and make a dry run, without opening the instrument or writing files.

    Args:
        model: for judging circles; None: the nominal machine.

    Raises:
        StationError: faults of files, travel, bar or instrument.
        ValueError: a choice is missing.
    """
    limits = limits or Limits()
    if choice.missing() or choice.folder is None:
        raise ValueError(f"missing: {', '.join(choice.missing())}")
    protocol = choice.line.protocol(lambda: None if choice.bar is None else read_bar(choice.bar).length_mm)
    machine, plan, plan_file, programs = _read(choice, limits)
    calibration = None if choice.bar is None else read_bar(choice.bar)
    bar = None if calibration is None else calibration.to_bar(protocol.length.stroke_mm)
    details = SessionDetails(
        serial_number=choice.serial_number,
        operator=choice.operator,
        ambient_temp_c=choice.ambient_temp_c,
        bar=bar,
        bar_waiver=choice.bar_waiver.strip(),
        job=choice.job.strip(),
    )
    job = Job(machine, plan, choice.folder, details, programs, model=model)
    job = job.read_by(protocol, choice.line.profile, choice.line.port, choice.line.baud)
    job.check(str(plan_file))
    domain = plan.to_domain()
    if not (choice.goes_on or choice.line.virtual or details.bar_waiver):
        check_bar_known(bar, domain, datetime.now(UTC), limits.largest_bar_age_h)
    recorded = _recorded(choice.folder, job.instrument) if choice.goes_on else ()
    left = Schedule(domain, recorded=recorded).open
    circles = [domain.tests[task.test].run(task.direction) for task in left]
    names = (*domain.tests, *domain.repeat_at_end)
    return Prepared(
        job,
        protocol,
        choice.line,
        len(left),
        circles_s(circles),
        mountings(domain, [task.test for task in left]),
        circles[0] if circles else None,
        height_and_drift([domain.tests[name].circle.centre_mm[2] for name in names], degree=1),
    )


def _recorded(folder: Path, instrument: ReadBy | None) -> tuple[RunEntry, ...]:
    session = read_session(folder)
    check_not_mixed(folder, session, instrument)
    return session.runs


def _read(choice: Choice, limits: Limits) -> tuple[Machine, PlanFile, Path, dict[tuple[str, Direction], RunProgram]]:
    folder = choice.folder
    if folder is not None and choice.goes_on:
        session = read_session(folder)
        machine, plan = session.machine, read_inline_plan(session.plan_path)
        commanded = any(run.program is not None for run in session.runs)
        programs = load_programs(folder / PROGRAMS, session.plan, machine) if commanded else {}
        return machine, plan, session.plan_path, programs
    if choice.machine is None or choice.plan is None:
        raise ValueError("machine or plan is missing")
    machine = read_machine(choice.machine)
    plan = ordered(read_inline_plan(choice.plan), choice.order, choice.gate)
    plan = with_loss(plan, limits.largest_loss_percent, over_plan=limits.loss_over_plan)
    programs = {} if choice.programs is None else load_programs(choice.programs, plan.to_domain(), machine)
    return machine, plan, choice.plan, programs
