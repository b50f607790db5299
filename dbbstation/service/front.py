"""The station's entry point: it lists sessions, choices and ports, and opens and closes jobs."""

from __future__ import annotations

import math
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import TYPE_CHECKING

from dbbstation.errors import InputError, StationError
from dbbstation.facts.serialise import as_objects
from dbbstation.files.places import unused_path
from dbbstation.files.recordings.session import read_session
from dbbstation.instrument.library import known_instruments, load_instrument, load_variants
from dbbstation.plan.bar import STEEL_BAR_UM_M_K, USUAL_TEMP_UNCERTAINTY_K
from dbbstation.service.after import JOINT, KINEMATIC, After
from dbbstation.service.bar_calibration import BarCalibration, fault_of
from dbbstation.service.choice import Choice, Limits, Prepared, SetUpPart, prepare
from dbbstation.service.held_line import HeldLine, HeldOpen, ProbeOutcome, ports, probe
from dbbstation.service.memory import VIRTUAL, Line, Memory
from dbbstation.service.runner import Runner, opener
from dbbstation.service.session_list import CandidateFormat, candidates, list_sessions
from dbbstation.service.virtual_place import virtual_place
from dbbstation.service.work import BackgroundWork, Call, WorkProgress
from dbbstation.system.ports import time_scale_of, virtual_port

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from dbbstation.instrument.protocol import Protocol
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.service.session_list import SessionLine
    from dbbstation.station.events import Observer


def line_to_go_on(folder: Path, remembered: Line, given: Line) -> Line:
    """Return instrument and port to continue an existing session."""
    try:
        session = read_session(folder)
    except InputError:  # what is wrong with it is said where it is opened
        return given
    if session.virtual:
        noted = session.instrument
        if remembered.virtual or noted is None:
            return remembered if remembered.virtual else given
        port = noted.port if time_scale_of(noted.port) is not None else virtual_port()
        return Line(instrument=noted.name, profile=noted.profile, port=port)
    if session.runs and given.virtual:
        return given.model_copy(update={"port": "", "baud": None})
    return given


USUAL_VIRTUAL = "streaming-encoder"
"""Instrument of a virtual machine if none was chosen."""


@dataclass(frozen=True, eq=False)
class Opened:
    """A job ready to start."""

    prepared: Prepared
    runner: Runner


@dataclass(frozen=True, eq=False)
class Front:
    """Finds, checks and opens one job at a time.

    Attributes:
        model: for judging circles; None: the nominal machine.
        given: choices of command line or settings, which override the memory.
        settings: named file of the shop's settings.
    """

    under: Path
    memory: Memory
    limits: Limits = field(default_factory=Limits)
    observers: Sequence[Observer] = ()
    model: IdentifiedModel | None = None
    given: Choice = field(default_factory=Choice)
    settings: Path | None = None
    _open: ExitStack = field(default_factory=ExitStack)
    _held: HeldOpen = field(default_factory=HeldOpen)

    def sessions(self) -> tuple[SessionLine, ...]:
        """Return sessions of the working folder and remembered ones, the last first."""
        return list_sessions(self.under, self.memory.read().sessions)

    def first_choice(self) -> Choice:
        """Return the last choice for a new session, without missing files."""
        last = self.memory.read()
        said = {name: getattr(self.given, name) or getattr(last, name) for name in ("operator", "serial_number")}
        files = {"machine": last.machine, "plan": last.plan}
        said |= {name: path for name, path in files.items() if path is not None and path.is_file()}
        return replace(self.given, folder=self.new_folder(), line=self._with_given(last.line), **said)

    def virtual_choice(self) -> Choice:
        """Return a complete choice without hardware."""
        machine = candidates(CandidateFormat.MACHINE, self.under)[-1]
        plan = next(
            path for path in candidates(CandidateFormat.PLAN, self.under) if path.name == "ten-minute-check.yaml"
        )
        line = Line(instrument=USUAL_VIRTUAL, port=VIRTUAL[-1])
        said = {name: getattr(self.given, name) for name in ("operator", "serial_number", "job", "order", "gate")}
        return Choice(self.new_folder("virtual"), machine, plan, line, **said)

    def goes_on_with(self, folder: Path) -> Choice:
        """Return the choice to continue a session."""
        line = self.memory.read().line_of(folder)
        return Choice(folder, line=line_to_go_on(folder, line, self._with_given(line)))

    def new_folder(self, name: str = "session") -> Path:
        """Return a free folder for a new session."""
        return unused_path(self.under, name)

    def files(self, part: SetUpPart) -> tuple[Path, ...]:
        """Return candidate files for a part."""
        kinds = {
            SetUpPart.MACHINE: CandidateFormat.MACHINE,
            SetUpPart.PLAN: CandidateFormat.PLAN,
            SetUpPart.BAR: CandidateFormat.BAR,
        }
        return candidates(kinds[part], self.under)

    def instruments(self) -> list[tuple[str, str]]:
        """Return name and profile of known instruments, usual profiles first."""
        return [(name, one.profile) for name in known_instruments() for one in load_variants(name)]

    def ports(self) -> list[tuple[str, str]]:
        """Return name and description of ports, with virtual machines."""
        return [*ports(), *((name, "no hardware, to try it") for name in VIRTUAL)]

    def probe(self, line: Line) -> ProbeOutcome:
        """Return the answer of the instrument at a port; this takes seconds."""
        if line.virtual:
            return ProbeOutcome(line.port, answers=True, text="is switched on when it is needed")
        try:
            # What a relative instrument calls zero does not matter for whether it answers.
            protocol = line.protocol(lambda: 0.0)
        except StationError as error:
            return ProbeOutcome(line.port, answers=False, text=str(error))
        self.release()  # only one can open a port
        return probe(protocol, line.port, line.baud)

    def hold(self, protocol: Protocol, line: Line) -> HeldLine | None:
        """Return the instrument, which stays open until another is requested; None if virtual."""
        return None if line.virtual else self._held.line(protocol, line.port, line.baud)

    def release(self) -> None:
        """Close the held instrument."""
        self._held.release()

    def prepare(self, choice: Choice) -> Prepared:
        """Check a choice; raises as `choice.prepare`."""
        return prepare(choice, self.limits, self.model)

    def models(self) -> tuple[Path, ...]:
        """Return compensating models, the latest first."""
        return tuple(sorted(candidates(CandidateFormat.MODEL, self.under), key=lambda path: -path.stat().st_mtime))

    def write_programs(self, choice: Choice, model: Path | None = None) -> tuple[int, Path]:
        """Write NC programs into a new folder beside the session; return number and folder.

        Raises:
            StationError: an error of the task.
            ValueError: plan or machine is missing.
        """
        plan, machine = choice.plan, choice.machine
        if choice.folder is not None and choice.goes_on:
            session = read_session(choice.folder)
            plan, machine = session.plan_path, session.machine_path
        if plan is None or machine is None or choice.folder is None:
            raise ValueError("plan, machine or folder is missing")
        folder = unused_path(choice.folder.parent, f"{choice.folder.name}-programs")
        given = {"plan": str(plan.absolute()), "machine": str(machine.absolute()), "out": str(folder.absolute())}
        call = Call(
            task="program",
            given=given if model is None else given | {"model": str(model.absolute())},
            beside=self.under.absolute(),
            settings=None if self.settings is None else self.settings.absolute(),
            force=False,
        )
        work = BackgroundWork(call, self.under)
        try:
            if work.wait() is not WorkProgress.DONE:
                raise StationError(work.failure())
            return len(as_objects(work.answer()).programs), folder
        finally:
            work.close()

    def bar_calibration(self, line: Line, values: Mapping[str, str]) -> BarCalibration:
        """Begin to read the bar on its calibrator; the result must be closed in any case.

        Args:
            values: as in `stated_bar`; a relative instrument shows zero at the calibrator's length.

        Raises:
            StationError: no such instrument.
            NoNumberError: a relative instrument needs the calibrator's length.
        """
        protocol = line.protocol(lambda: _number(values, "calibrator_mm"))
        return BarCalibration(self._held.line(protocol, line.port, line.baud))

    def stated_bar(self, values: Mapping[str, str]) -> tuple[dict[str, object], dict[str, object]]:
        """Return the stated facts of bar and calibrator by the keys of the bar's file.

        Raises:
            NoNumberError: a text is no number.
        """
        calibrator: dict[str, object] = {
            "serial_number": values["calibrator"],
            "length_mm": _number(values, "calibrator_mm"),
            "uncertainty_um": _number(values, "calibrator_u_um"),
            "certified": values["certified"],
            "valid_until": values["valid_until"] or None,
        }
        return {
            "serial_number": values["serial_number"],
            "temp_c": _number(values, "temp_c"),
            "temp_uncertainty_k": USUAL_TEMP_UNCERTAINTY_K,
            "expansion_um_m_k": STEEL_BAR_UM_M_K,
        }, calibrator

    def fault_of_stated(self, name: str, text: str, line: Line, reads_mm: float | None) -> str:
        """Return a typed text's fault, or an empty text.

        Args:
            line: its instrument; a relative one does not show the calibrator's length.
            reads_mm: current reading, or None.
        """
        length = load_instrument(line.instrument, line.profile or None).length
        return fault_of(name, text, None if length.relative else reads_mm, length.stroke_mm)

    def off_calibrator_um(self, length_mm: float, values: Mapping[str, str]) -> float | None:
        """Return a reading's excess over the calibrator [µm]; None if its length is not stated."""
        try:
            return 1e3 * (length_mm - _number(values, "calibrator_mm"))
        except ValueError:
            return None

    def new_bar_file(self) -> Path:
        """Return a free file for a bar calibration."""
        return unused_path(self.under, f"bar-{datetime.now().astimezone():%Y-%m-%d}", ".yaml")

    def open(self, choice: Choice, prepared: Prepared) -> Opened:
        """Start virtual parts, remember the choice and return the sequence's runner.

        Raises:
            StationError: the virtual machine refuses, or another process writes into the session.
        """
        self._open.close()
        job, line = prepared.job, prepared.line
        observers = [*self.observers]
        held = self.hold(prepared.protocol, line)
        if held is None:
            place = self._open.enter_context(virtual_place(job, prepared.protocol, line.time_scale))
            job = place.job
            observers.append(place.helper)
            held = HeldLine(prepared.protocol, place.port, clock=job.clock, time_scale=line.time_scale)
            self._open.callback(held.close)
        self._remember(choice)
        runner = Runner(opener(job, held, observers=observers), held)
        self._open.callback(runner.close)
        return Opened(replace(prepared, job=job), runner)

    def close(self) -> None:
        """End sequence, virtual parts and instrument."""
        self._open.close()
        self.release()

    def after(self, session: Path) -> After:
        """Return the tasks on a measured session."""
        return After(session, self.last_model(session), self.settings)

    def last_model(self, session: Path) -> Path | None:
        """Return the latest model beside a session, by its usual name, or None."""
        found = [
            (path.stat().st_mtime, path.name == JOINT, path)
            for name in (KINEMATIC, JOINT)
            for path in session.absolute().parent.glob(f"*-results*/{name}")
        ]
        return max(found)[2] if found else None

    def _with_given(self, line: Line) -> Line:
        given = {key: value for key, value in self.given.line.model_dump().items() if value not in {"", None}}
        if "instrument" in given and given["instrument"] != line.instrument:
            line = line.model_copy(update={"profile": "", "zero_mm": None})
        return line.model_copy(update=given)

    def _remember(self, choice: Choice) -> None:
        last = self.memory.read()
        if choice.folder is None:
            return
        now = {
            "machine": choice.machine and choice.machine.absolute(),
            "plan": choice.plan and choice.plan.absolute(),
            "operator": choice.operator,
            "serial_number": choice.serial_number,
        }
        kept = last.model_copy(update={name: value for name, value in now.items() if value})
        self.memory.write(kept.with_session(choice.folder, choice.line))


class NoNumberError(ValueError):
    """A text that should be a number, but is not."""

    def __init__(self, name: str, text: str) -> None:
        self.name, self.text = name, text
        super().__init__(f"{name}: `{text}` is no number")


def _number(values: Mapping[str, str], name: str) -> float:
    text = values.get(name, "").replace(",", ".")
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise NoNumberError(name, text)
    return number
