"""Sessions that are found, choices that are remembered, ports that answer, work that can be ended."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import get_args

import pytest

from dbbstation.cli.session_options import RecordingOptions
from dbbstation.errors import InputError, TravelError
from dbbstation.files.formats.plan import read_inline_plan, read_plan
from dbbstation.files.formats.session import Note
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.session import read_session
from dbbstation.files.recordings.session_writer import SessionWriter
from dbbstation.instrument.library import load_instrument
from dbbstation.plan.plan import circle_s
from dbbstation.service.after import After, Result
from dbbstation.service.choice import Choice, Gate, Order, SetUpPart, ordered
from dbbstation.service.front import Front
from dbbstation.service.held_line import probe
from dbbstation.service.memory import MOST, VIRTUAL, Line, Memory, Remembered
from dbbstation.service.session_list import CandidateFormat, candidates, list_sessions
from dbbstation.service.session_notes import add_note, shop_degc
from dbbstation.service.work import BackgroundWork, Call, SessionTask, WorkProgress
from dbbstation.tasks.declare import options_of
from dbbstation.virtual.wire import VirtualInstrument
from tests.cli.conftest import call

SMALL = shipped_folder("fixtures") / "sessions" / "small"
MACHINE = shipped_folder("fixtures") / "machines" / "reference.yaml"
PLAN = shipped_folder("protocols") / "plans" / "ten-minute-check.yaml"
REAL = Line(instrument="heidenhain-nd281b", port="/dev/ttyUSB7")
PATIENCE_S = 60.0


@pytest.fixture
def front(tmp_path: Path) -> Front:
    return Front(tmp_path / "shop", Memory(tmp_path / "state" / "station.json"))


@pytest.fixture
def session(front: Front) -> Path:
    folder = front.under / "hexapod-7" / "monday"
    shutil.copytree(SMALL, folder)
    return folder


def ended(work: BackgroundWork) -> WorkProgress:
    end_s = time.monotonic() + PATIENCE_S
    while work.progress is WorkProgress.RUNNING:
        assert time.monotonic() < end_s
        time.sleep(0.02)
    return work.progress


def test_sessions_are_found_with_what_is_left_of_them(front: Front, session: Path) -> None:
    (line,) = front.sessions()
    assert (line.folder, line.problem) == (session, "")
    plan = read_plan(SMALL / "plan.yaml")
    assert line.plan == plan.name
    planned = sum(len(test.directions) for test in plan.tests.values()) + sum(
        len(plan.tests[name].directions) for name in plan.repeat_at_end
    )
    assert line.planned == planned
    # Once rejected, a run is left again, and its circle's time with it.
    assert line.complete
    assert line.left_s == 0.0
    first = next(iter(plan.tests.values()))
    done = call("session", "reject", session, f"{first.name}-{first.directions[0]}-1", "--reason", "seen later")
    assert done.code == 0, done.err
    (line,) = front.sessions()
    assert (line.planned - line.accepted, line.complete) == (1, False)
    assert line.left_s == pytest.approx(circle_s(first.run(first.directions[0])))


def test_a_session_with_faults_says_so_and_hides_no_other(front: Front, session: Path) -> None:
    broken = front.under / "tuesday"
    shutil.copytree(session, broken)
    (broken / "machine.yaml").unlink()
    lines = {line.folder: line for line in front.sessions()}
    assert lines[session].problem == ""
    assert lines[broken].problem


def test_remembered_sessions_are_listed_wherever_they_are_and_gone_ones_are_not(
    front: Front, session: Path, tmp_path: Path
) -> None:
    elsewhere = tmp_path / "elsewhere" / "here"
    shutil.copytree(session, elsewhere)
    found = list_sessions(front.under, [elsewhere, session, tmp_path / "gone"])
    assert {line.folder for line in found} == {session, elsewhere}


def test_choices_are_remembered(front: Front, session: Path, tmp_path: Path) -> None:
    remembered = Remembered(machine=MACHINE, plan=PLAN, line=REAL, operator="me", serial_number="H-7").with_session(
        session, REAL
    )
    front.memory.write(remembered)
    assert front.memory.read() == remembered
    choice = front.first_choice()
    assert (choice.machine, choice.plan, choice.line, choice.operator) == (MACHINE, PLAN, REAL, "me")
    assert choice.folder == front.under / "session"
    again = front.goes_on_with(session)
    assert again.missing() == ()
    assert again.line == REAL
    # A port that the shop's settings name holds over the one of last time.
    told = replace(front, given=Choice(line=Line(port="COM3")))
    assert told.goes_on_with(session).line == REAL.model_copy(update={"port": "COM3"})
    for number in range(2 * MOST):
        remembered = remembered.with_session(tmp_path / str(number), REAL)
    assert len(remembered.sessions) == MOST
    assert next(iter(remembered.sessions)) == tmp_path / str(2 * MOST - 1)


def test_a_virtual_machine_is_never_offered_unless_it_is_asked_for(front: Front, session: Path) -> None:
    tried = front.under / "virtual"
    virtual = front.virtual_choice().line
    front.memory.write(Remembered(line=REAL).with_session(tried, virtual))
    assert front.goes_on_with(tried).line == virtual
    assert front.first_choice().line == REAL
    assert front.goes_on_with(session).line == REAL
    front.memory.write(Remembered().with_session(tried, virtual))
    assert SetUpPart.PORT in front.first_choice().missing()
    assert SetUpPart.PORT in front.goes_on_with(session).missing()
    # As a program before this one wrote it.
    text = front.memory.path.read_text()
    front.memory.path.write_text(_with_last_line(text, virtual))
    assert SetUpPart.PORT in front.first_choice().missing()


def _with_last_line(text: str, line: Line) -> str:
    said = json.loads(text)
    return json.dumps({**said, "line": line.model_dump()})


@pytest.mark.parametrize("content", [b"", b"{", b'{"machine": 7}', b"\xff\xfe", b'{"unknown": 1}'])
def test_a_memory_that_is_not_understood_is_none(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "station.json"
    file.write_bytes(content)
    assert Memory(file).read() == Remembered()


def test_a_memory_that_cannot_be_kept_harms_nobody(tmp_path: Path) -> None:
    (tmp_path / "a-file").write_text("")
    Memory(tmp_path / "a-file" / "station.json").write(Remembered(operator="me"))


def test_files_to_choose_from_are_known_by_their_format(front: Front, session: Path) -> None:
    shutil.copy(PLAN, front.under / "mine.yaml")
    (front.under / "notes.yaml").write_text("a: 1\n")
    plans = candidates(CandidateFormat.PLAN, front.under)
    assert plans[0] == front.under / "mine.yaml"
    assert PLAN in plans
    assert not [path for path in plans if session in path.parents]
    assert candidates(CandidateFormat.PLAN, front.under, shipped=False) == (front.under / "mine.yaml",)
    assert MACHINE in candidates(CandidateFormat.MACHINE, front.under)


def test_a_port_answers_with_its_reading_or_says_what_is_wrong() -> None:
    protocol = load_instrument("heidenhain-nd281b")
    with VirtualInstrument(protocol, lambda _t_s: 150.0123) as wire:
        answer = probe(protocol, wire.port)
    assert (answer.answers, answer.text) == (True, "150.0123 mm")
    with VirtualInstrument(protocol, lambda _t_s: None) as wire:
        assert probe(protocol, wire.port).text.startswith("no bar")
    gone = probe(protocol, "/dev/no-such-port")
    assert not gone.answers
    assert "no such port" in gone.text


def test_what_is_missing_is_told_in_the_order_it_is_asked_for(front: Front) -> None:
    assert Choice().missing() == (
        SetUpPart.MACHINE,
        SetUpPart.PLAN,
        SetUpPart.INSTRUMENT,
        SetUpPart.PORT,
        SetUpPart.BAR,
        SetUpPart.FOLDER,
    )
    assert front.virtual_choice().missing() == ()
    with pytest.raises(ValueError, match="port"):
        front.prepare(Choice())


def test_a_choice_is_dry_run_and_timed(front: Front) -> None:
    choice = replace(front.virtual_choice(), plan=PLAN)
    prepared = front.prepare(choice)
    plan = read_plan(PLAN)
    each = [circle_s(test.run(way)) for test in plan.tests.values() for way in test.directions]
    assert prepared.circles_s == pytest.approx(sum(each))
    assert choice.folder is not None
    assert not choice.folder.exists()


def test_a_plan_beyond_the_travel_is_refused(front: Front) -> None:
    front.under.mkdir()
    far = front.under / "far.yaml"
    far.write_text(PLAN.read_text("utf-8").replace("[0, 0, -1150]", "[900, 0, -1150]"), "utf-8")
    with pytest.raises(TravelError):
        front.prepare(replace(front.virtual_choice(), plan=far))


def test_a_real_session_needs_the_bar_or_a_reason(front: Front) -> None:
    choice = Choice(front.new_folder(), MACHINE, PLAN, REAL)
    assert choice.missing() == (SetUpPart.BAR,)
    bar = shipped_folder("fixtures") / "bars" / "zerodur.yaml"
    with pytest.raises(InputError, match="last on its calibrator"):
        front.prepare(replace(choice, bar=bar))
    waived = front.prepare(replace(choice, bar_waiver="a first look", job=" order 4711 "))
    assert (waived.job.details.bar_waiver, waived.job.details.job) == ("a first look", "order 4711")


def test_work_answers_with_its_result(session: Path, tmp_path: Path) -> None:
    work = BackgroundWork(Call(task="calibrate", given={}, outputs={"out": "model.yaml"}, beside=tmp_path), tmp_path)
    assert ended(work) is WorkProgress.FAILED
    assert work.failure().splitlines() == [
        "TypeError: missing a required argument: 'sessions'",
        "this is a fault of dbbstation itself; the log shows what to report",
    ]
    work.close()
    given = {"sessions": str(tmp_path / "gone"), "page": "report.html"}
    gone = Call(task="report", given=given, beside=tmp_path)
    work = BackgroundWork(gone, tmp_path)
    assert ended(work) is WorkProgress.FAILED
    assert "gone" in work.failure()
    assert "fault of dbbstation" not in work.failure()
    work.close()
    work = BackgroundWork(gone.model_copy(update={"given": given | {"sessions": str(session)}}), tmp_path)
    assert ended(work) is WorkProgress.DONE
    assert work.answer()["report"] == "report.html"
    assert "dbbstation report monday" in (tmp_path / "report.html").read_text("utf-8")
    assert work.stage
    work.close()


def test_work_can_be_ended(session: Path, tmp_path: Path) -> None:
    work = BackgroundWork(
        Call(task="diagnose", given={"sessions": str(session)}, outputs={"out": "joint.yaml"}, beside=tmp_path),
        tmp_path,
    )
    end_s = time.monotonic() + PATIENCE_S
    while not work.stage:
        assert time.monotonic() < end_s
        time.sleep(0.02)
    work.cancel()
    assert ended(work) is WorkProgress.CANCELLED
    work.close()
    assert work.passed_s < PATIENCE_S
    assert list(tmp_path.glob("joint*")) == []


def test_the_station_does_not_load_what_is_computed() -> None:
    script = "import sys, dbbstation.service.front; sys.exit(','.join(m for m in sys.modules if m.startswith('dbbstation.tasks')))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.stderr.strip() == ""


class Scripted:
    """Stands where a job is done: ends as it is told to."""

    stage = "fit of 6 runs"
    passed_s = 1.0

    def __init__(self, call: Call, folder: Path) -> None:
        self.call, self.folder = call, folder
        self.progress = WorkProgress.RUNNING

    def answer(self) -> dict[str, str]:
        return {"from": self.call.task}

    def failure(self) -> str:
        return "it failed"

    def cancel(self) -> None:
        self.progress = WorkProgress.CANCELLED

    def close(self) -> None:
        pass


def test_steps_after_a_session_follow_each_other_and_use_the_best_model(session: Path) -> None:
    begun: list[Scripted] = []

    def start(call: Call, folder: Path) -> Scripted:
        begun.append(Scripted(call, folder))
        return begun[-1]

    after = After(session, start=start)  # type: ignore[arg-type]
    assert not after.can(SessionTask.PROGRAMS)
    after.do(SessionTask.CALIBRATE, SessionTask.PROGRAMS, SessionTask.REPORT)
    for work in range(3):
        after.look()
        assert after.busy is not None
        assert after.results[after.busy].stage == "fit of 6 runs"
        begun[work].progress = WorkProgress.DONE
        after.look()
    results = session.parent / "monday-results"
    assert after.busy is None
    assert after.folder == results
    assert [one.call.task for one in begun] == ["calibrate", "program", "report"]
    assert [one.call.given.get("model") for one in begun] == [None, *2 * [str(results / "model.yaml")]]
    assert after.results[SessionTask.REPORT].path == results / "report.html"
    after.do(SessionTask.DIAGNOSE, SessionTask.REPORT)
    after.look()
    after.cancel()
    after.look()
    assert (after.busy, after.results[SessionTask.DIAGNOSE].progress) == (None, WorkProgress.CANCELLED)
    assert after.model == results / "model.yaml"
    # The next sitting goes on with it, as long as the same runs count.
    assert After(session).folder == results


def test_a_failure_ends_the_row_and_says_why(session: Path) -> None:
    after = After(session, start=Scripted)  # type: ignore[arg-type]
    after.do(SessionTask.CALIBRATE, SessionTask.REPORT)
    after._running[1].progress = WorkProgress.FAILED
    after.look()
    assert after.results[SessionTask.CALIBRATE].failure == "it failed"
    assert after.results[SessionTask.REPORT] == Result()


def test_virtual_ports_are_offered(front: Front) -> None:
    assert {name for name, _ in front.ports()} >= set(VIRTUAL)
    assert front.probe(Line(instrument="streaming-encoder", port=next(iter(VIRTUAL)))).answers


@pytest.mark.usefixtures("copied_works")
def test_programs_are_written_beside_the_session_and_commanded_by(front: Front) -> None:
    front.under.mkdir()
    choice = front.virtual_choice()
    count, folder = front.write_programs(choice)
    again, other = front.write_programs(choice)
    plan = read_plan(PLAN)
    runs = [(name, way) for name, test in plan.tests.items() for way in test.directions]
    assert count == again == len(runs)
    assert (folder.name, other.name) == ("virtual-programs", "virtual-programs-2")
    prepared = front.prepare(replace(choice, programs=folder))
    assert set(prepared.job.programs) == set(runs)


def test_the_order_by_holder_puts_each_up_once(tmp_path: Path) -> None:
    text = PLAN.read_text("utf-8")
    low = "  - {name: low, ball: 9-short, a_deg: 0, b_deg: 0}\n"
    file = tmp_path / "plan.yaml"
    file.write_text(f"{text.rstrip()}\n{low.replace('name: low', 'name: last')}", "utf-8")
    plan = read_inline_plan(file)
    assert list(ordered(plan, Order.PLAN).to_domain().tests) == ["low", "side", "high", "last"]
    by_holder = ordered(plan, Order.HOLDER, Gate.FIRST).to_domain()
    assert list(by_holder.tests) == ["low", "last", "side", "high"]
    assert by_holder.repeat_at_end == ("low",)
    assert ordered(plan, Order.PLAN).to_domain().repeat_at_end == ()


def test_the_checklist_says_what_an_order_costs_and_whether_heights_follow_a_drift(front: Front) -> None:
    table2 = shipped_folder("protocols") / "plans" / "table2.yaml"
    choice = replace(front.virtual_choice(), plan=table2)
    as_planned = front.prepare(choice)
    assert (as_planned.runs, as_planned.mountings, as_planned.mixes_drift) == (30, 15, True)
    in_turn = front.prepare(replace(choice, order=Order.DRIFT, gate=Gate.HOLDERS))
    assert (in_turn.runs, in_turn.mountings, in_turn.mixes_drift) == (36, 18, False)


def test_what_the_command_line_says_holds_for_the_virtual_machine_too(front: Front) -> None:
    told = replace(front, given=Choice(job="order 4711", order=Order.HOLDER, gate=Gate.FIRST, bar_waiver="none"))
    choice = told.virtual_choice()
    assert (choice.job, choice.order, choice.gate, choice.bar_waiver) == ("order 4711", Order.HOLDER, Gate.FIRST, "")
    assert choice.missing() == ()


def test_a_temperature_is_never_noted_before_what_was_noted_already(tmp_path: Path) -> None:
    folder = tmp_path / "session"
    shutil.copytree(SMALL.parent / "logged", folder)
    ahead = datetime.now(UTC) + timedelta(minutes=5)
    with SessionWriter.open(folder) as writer:
        writer.note(Note(ahead, ambient_temp_c=20.0))
    add_note(folder, degc=20.9)
    assert [(note.made >= ahead, note.ambient_temp_c) for note in read_session(folder).notes[1:]] == [
        (True, 20.0),
        (True, 20.9),
    ]
    add_note(folder, degc=21.0)
    assert shop_degc("20,9") == 20.9
    assert [shop_degc(text) for text in ("", "warm", "nan", "inf", "81", "-31")] == [None] * 6


def test_the_orders_of_the_command_line_are_those_of_the_service() -> None:
    options = options_of(RecordingOptions)
    assert tuple(Order) == get_args(options["order"].type)
    assert tuple(Gate) == get_args(options["gate"].type)
