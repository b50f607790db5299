"""A job for an operator: four screens, one answer."""

from __future__ import annotations

import asyncio
import os
import shutil
import time
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING

import pytest
from textual.widgets import Static

from dbbstation.errors import InputError, InstrumentError
from dbbstation.facts.held import ReportVerdict, WorstCircle
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.formats.session import Note, SessionDetails
from dbbstation.files.formats.settings import read_settings
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.session import read_session
from dbbstation.files.recordings.session_writer import SessionWriter
from dbbstation.plan.plan import Direction
from dbbstation.plan.tolerance import CircleFigure, Tolerance
from dbbstation.quality.conformity import Conformity
from dbbstation.quality.finding import Name, found
from dbbstation.service.board import Board, Message, RunDecision, Weight, message_of
from dbbstation.service.front import Front
from dbbstation.service.memory import Memory
from dbbstation.service.operated import SHIFT_S, Answered, JobAnswer, answer_of, read_operated
from dbbstation.service.work import Call, WorkProgress
from dbbstation.station.assembly import Job, assemble
from dbbstation.station.commands import Accept, AddNote, GoTo, Judge, Quit, Repeat
from dbbstation.station.events import Fault
from dbbstation.station.opening import changed_since, clock_watch
from dbbstation.tui.app import StationApp
from dbbstation.tui.operator_screens import AnswerScreen, JobScreen, OperateScreen
from dbbstation.tui.overview_screen import OverviewScreen
from dbbstation.tui.questions import YesQuestion
from dbbstation.tui.sentences import now as sentence_now
from dbbstation.tui.sentences import now_for_operator
from tests.cli.conftest import call
from tests.tui.happenings import Happening
from tests.tui.test_app import Waits
from tests.tui.test_session_flow import below, now, rows

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from textual.pilot import Pilot

    from dbbstation.station.engine import Station

FIXTURES = shipped_folder("fixtures")
PLANS = shipped_folder("protocols") / "plans"


@pytest.fixture
def job_file(tmp_path: Path) -> Path:
    text = (FIXTURES / "jobs" / "virtual.yaml").read_text(encoding="utf-8")
    text = text.replace("../../protocols/plans", str(PLANS)).replace("../machines", str(FIXTURES / "machines"))
    path = tmp_path / "monday.yaml"
    path.write_text(text, encoding="utf-8")
    return path


class Reported:
    """A report that is made at once."""

    progress, stage, passed_s = WorkProgress.DONE, "", 1.0
    kind = "within"

    def __init__(self, call: Call, folder: Path) -> None:
        assert call.tolerances is not None
        self.settings = read_settings([call.tolerances])
        (folder / "report.html").write_text("a report", encoding="utf-8")

    def answer(self) -> dict[str, object]:
        told = {"kind": self.kind, "headline": "Every circle is within.", "reasons": [], "to_do": ["Measure again."]}
        return {"verdict": told, "tolerances": []}

    def close(self) -> None:
        pass


def test_a_job_is_checked_with_all_that_it_names(job_file: Path) -> None:
    assert call("check", job_file).code == 0
    text = job_file.read_text(encoding="utf-8")
    for broken, says in (
        (text.replace("unit: µm}", "unit: µm, tests: [hihg]}"), "the plan has no test `hihg`"),
        (text.replace("ten-minute-check", "no-such-plan"), "no-such-plan.yaml"),
        (text.replace("may_change: [operator]", "may_change: [plan]"), "may_change"),
        (text + "bar: bar.yaml\n", "bar.yaml"),
        (text.replace("10 times faster", "100 times faster"), "is no virtual machine"),
        (text.replace("streaming-encoder", "streaming-encodr"), "streaming-encodr"),
        (text.replace("streaming-encoder", "gauge.yaml"), str(job_file.parent / "gauge.yaml")),
        (
            text.replace("port: virtual machine, 10 times faster", "port: COM3").replace("bar_waiver", "#"),
            "neither a bar",
        ),
    ):
        job_file.write_text(broken, encoding="utf-8")
        outcome = call("check", job_file)
        assert outcome.code == 1
        assert says in outcome.out + outcome.err
        with pytest.raises(InputError):
            read_operated(job_file)


def test_the_answer_is_one_word_and_a_missing_circle_is_no_within(job_file: Path) -> None:
    session = shutil.copytree(FIXTURES / "sessions" / "virtual", job_file.parent / "monday-2026-11-20")
    operated = read_operated(job_file)
    tolerances = read_settings([operated.tolerances_file(session)]).tolerances
    assert tolerances == (Tolerance(CircleFigure.CIRCULAR_DEVIATION, 400.0),)
    answer = JobAnswer(operated, session, (), Reported).look()
    assert answer == Answered(
        Conformity.WITHIN,
        ("Every circle is within the limits of the job, with its uncertainty.",),
        ("Measure again.",),
        job_file.parent / "monday-2026-11-20-results" / "report.html",
    )
    worst = WorstCircle("low", "ccw", 1, um=12.0, expanded_um=0.5, why_not=None)
    tolerance = SimpleNamespace(worst=worst, quantity="circular-deviation", largest_um=20.0)
    for kind, missing, word in (
        ("within", (), Conformity.WITHIN),
        ("within", ("high cw",), Conformity.UNDECIDED),
        ("exceeded", ("high cw",), Conformity.EXCEEDED),
        ("cannot tell", (), Conformity.UNDECIDED),
        ("none", (), Conformity.UNDECIDED),
    ):
        verdict = ReportVerdict(kind, "All within.", (), ("`dbbstation calibrate` it.", "Look after the ball."))
        told = answer_of(
            SimpleNamespace(verdict=verdict, tolerances=(tolerance,)), missing, None, "Do not cut, call 4711."
        )
        assert told.word is word
        # No command that the operator cannot reach; the shop's own words where the machine is not within.
        assert not any("dbbstation" in step for step in told.to_do)
        assert ("Do not cut, call 4711." in told.to_do) is (kind != "within")
        worst = "Circular deviation: 12.0 µm at most (low ccw 1), U 0.5 µm, limit 20 µm, margin 7.5 µm."
        assert (worst in told.reasons) is (kind == "within")
        assert ("Not measured: high cw." in told.reasons) is bool(missing)
    # Another plan than the session has: a new session is begun.
    assert operated.choice().folder != session
    assert operated.choice().line.virtual


def test_four_screens_and_nothing_that_is_wrong_is_accepted(job_file: Path) -> None:
    front = Front(job_file.parent, Memory(job_file.parent / "state.json"))
    operated = read_operated(job_file)
    wrong = (found(Name.FEED, 100.0, 10.0, "", "the feed", "feed 1100 of 1000 mm/min"),)
    runner = Waits(Happening(findings=wrong).circle("t0", Direction.CCW).events)

    async def run() -> None:
        app = StationApp(None, None, front=front, operated=operated)
        async with app.run_test(size=(80, 24)) as pilot:
            for _ in range(300):
                app.look()
                if "Enter begins" in now(app):
                    break
                await pilot.pause(0.02)
            assert isinstance(app.screen, JobScreen)
            assert [row.replace("▸", "").split()[0] for row in rows(app)] == ["Begin:", "operator"]
            assert "at most 400 µm of circular deviation, all tests" in below(app)
            await pilot.press("n", "e", "v", "down", "enter")  # no letter leads anywhere else
            await pilot.press(*"ann", "enter")
            assert "ann" in rows(app)[1]
            # Beside the machine, as `open` does it.
            app._runner, app._show = runner, Happening().shown()
            await app.push_screen(OperateScreen(app, app._show))
            await pilot.pause()
            app.look()
            await pilot.pause()
            await pilot.press("a", "x", "s", "f", "e", "t")
            assert isinstance(app.screen, OperateScreen)
            await pilot.press("o", "x", "a")
            assert isinstance(app.screen, OverviewScreen)
            await pilot.press("escape")
            assert runner.sent == []
            await pilot.press("f1")
            helped = " ".join(str(part.render()) for part in app.screen.query(Static))
            assert "All messages with all their words." in helped
            assert "All tests of the plan on a map" in helped
            assert "Large figures for two metres" not in helped
            await pilot.press("escape")
            await pilot.press("enter")
            assert runner.sent == [Repeat()]
            session = shutil.copytree(FIXTURES / "sessions" / "virtual", job_file.parent / "monday-1")
            answer = AnswerScreen(
                JobAnswer(operated, session, (), Reported), lambda: app.leave(sure=True), virtual=True
            )
            app.push_screen(answer)
            await pilot.pause()
            answer.look()
            text = str(answer.query_one("#answer-word").visual)
            assert "WITHIN" in text
            assert "██" in text
            assert "VIRTUAL MACHINE" in str(answer.query_one("#row-title").visual)
            assert "report.html" in str(answer.query_one("#answer-text").visual)
            await pilot.press("enter")
            assert runner.sent == [Repeat(), Quit()]

    asyncio.run(run())


def test_a_sound_circle_is_accepted_by_enter() -> None:
    sound = (found(Name.CLOSURE, 0.1, 1.0, "", ""),)
    runner = Waits(Happening(findings=sound).circle("t0", Direction.CCW).events)
    app = StationApp(Happening().shown(), runner, clock=lambda: 0.0)

    async def run() -> None:
        async with app.run_test(size=(80, 24)) as pilot:
            await app.push_screen(OperateScreen(app, Happening().shown()))
            app.look()
            await pilot.pause()
            await pilot.press("enter")

    asyncio.run(run())
    assert runner.sent == [Accept()]


def test_a_circle_that_cannot_be_told_has_a_key_of_its_own() -> None:
    runner = Waits(Happening().circle("t0", Direction.CCW).events)  # nothing was looked for
    app = StationApp(Happening().shown(), runner, clock=lambda: 0.0)

    async def run() -> None:
        async with app.run_test(size=(80, 24)) as pilot:
            await app.push_screen(OperateScreen(app, Happening().shown()))
            app.look()
            await pilot.pause()
            said = " ".join(str(app.screen.query_one("#now").visual).split())
            assert "It takes an overlap in the plan; two other tests, a model or a session before" in said
            await pilot.press("enter", "u")

    asyncio.run(run())
    (sent,) = runner.sent
    assert isinstance(sent, Accept)
    assert sent.reason.startswith("not to be seen: whether something moved during the circle, whether it is the circle")


@pytest.mark.parametrize("operated", [False, True])
def test_a_second_run_of_a_test_and_direction_is_offered_in_place_of_the_first(*, operated: bool) -> None:
    sound = (found(Name.CLOSURE, 0.1, 1.0, "", ""),)
    happening = Happening(findings=sound).circle("t0", Direction.CCW).command(Accept())
    happening.command(GoTo("t0", Direction.CCW)).circle("t0", Direction.CCW)
    runner = Waits(happening.events)
    app = StationApp(happening.shown(), runner, clock=lambda: 0.0)

    async def run() -> None:
        async with app.run_test(size=(80, 24)) as pilot:
            if operated:
                await app.push_screen(OperateScreen(app, happening.shown()))
            app.look()
            await pilot.pause()
            said = " ".join(str(app.screen.query_one("#now").visual).split())
            assert "t0-ccw-1 counts too: Z accepts this one in its place." in said
            await pilot.press("z")

    asyncio.run(run())
    assert runner.sent == [Accept(alone=True)]
    both = happening.sequencer.command(Accept())[0]
    assert message_of(both) == Message(Weight.WARNING, "t0-ccw-2 accepted; t0-ccw-1 counts too")
    happening.sequencer.command(Judge("t0", Direction.CCW, 1, accepted=False))
    told = happening.sequencer.command(Judge("t0", Direction.CCW, 1, accepted=True))[0]
    assert message_of(told) == Message(Weight.WARNING, "t0-ccw-1 accepted; t0-ccw-2 counts too")


def test_the_older_run_does_not_count_after_the_newer_took_its_place() -> None:
    happening = Happening().circle("t0", Direction.CCW).command(Accept(), GoTo("t0", Direction.CCW))
    happening.circle("t0", Direction.CCW).command(Accept(alone=True))
    board = happening.board()
    assert board.verdicts["t0-ccw-1"] is RunDecision.REJECTED
    assert board.verdicts["t0-ccw-2"] is RunDecision.ACCEPTED
    assert board.reasons["t0-ccw-1"] == "t0-ccw-2 counts in its place"


def test_a_job_begins_anew_asks_for_what_is_required_and_after_a_shift(job_file: Path) -> None:
    text = job_file.read_text(encoding="utf-8").replace(
        "may_change: [operator]", "may_change: [operator]\nrequired: [operator]"
    )
    job_file.write_text(text.replace("operator: ", "# "), encoding="utf-8")
    front = Front(job_file.parent, Memory(job_file.parent / "state.json"))
    operated = read_operated(job_file)
    folder = operated.choice().folder
    assert folder is not None
    SessionWriter.create(
        folder,
        read_machine(FIXTURES / "machines" / "reference.yaml"),
        read_inline_plan(PLANS / "ten-minute-check.yaml"),
        SessionDetails(),
    ).close()
    long_ago = time.time() - 1.5 * SHIFT_S
    os.utime(folder / "session.yaml", (long_ago, long_ago))

    async def run() -> None:
        app = StationApp(None, None, front=front, operated=operated)
        async with app.run_test(size=(80, 24)) as pilot:
            await looked(app, pilot, lambda: "Enter begins" in now(app))
            assert "Go on with session" in rows(app)[0]
            await pilot.press("enter")
            assert "Still required: operator" in now(app)
            await pilot.press("down", "down", "enter", *"ann", "enter", "up", "up", "enter")
            assert isinstance(app.screen, YesQuestion)
            await pilot.press("n", "down", "enter")
            await looked(app, pilot, lambda: rows(app)[0].replace("▸", "").strip().startswith("Begin:"))
            assert folder.name not in rows(app)[0].split()

    asyncio.run(run())


async def looked(app: StationApp, pilot: Pilot[None], there: Callable[[], bool]) -> None:
    for _ in range(300):
        app.look()
        if there():
            return
        await pilot.pause(0.02)
    raise AssertionError(now(app), rows(app))


def test_another_operator_temperature_or_shift_and_a_clock_set_back_are_noted() -> None:
    now = datetime.now(UTC)
    later, long_ago = now + timedelta(hours=2), now - timedelta(hours=20)
    session = SimpleNamespace(operator="bob", ambient_temp_c=20.0, notes=(), virtual=False, runs=())
    ann = SessionDetails(operator="ann", ambient_temp_c=20.5)
    operator, degc, clock = changed_since(SimpleNamespace(**vars(session) | {"runs": [Started(later)]}), ann)
    assert operator == AddNote("operator from here on: ann")
    assert degc == AddNote(ambient_temp_c=20.5)
    assert "it was set back" in clock.text
    (shift,) = changed_since(
        SimpleNamespace(**vars(session) | {"runs": [Started(long_ago)]}), SessionDetails(operator="bob")
    )
    assert shift.text == "gone on with 20 h after what was noted last"
    told = SimpleNamespace(**vars(session) | {"notes": (Note(now, operator.text), Note(now, "", 20.5))})
    assert list(changed_since(told, ann)) == []
    assert list(changed_since(told, SessionDetails(operator="bob"))) == [AddNote("operator from here on: bob")]


class Started(SimpleNamespace):
    def __init__(self, started: datetime) -> None:
        super().__init__(started=started)


def test_a_clock_that_is_set_while_the_station_runs_is_told_once() -> None:
    told: list[AddNote] = []
    ahead_s = iter([100.0, 100.0, 100.4, 100.8, 3700.8, 3700.8, 3580.8, 3580.8])
    look = clock_watch(told.append, lambda: next(ahead_s), lambda: 0.0)
    for _ in range(7):
        look()
    assert [one.text for one in told] == [
        "the computer's clock was set on by 3600 s",
        "the computer's clock was set back by 120 s",
    ]


def test_what_changed_is_noted_and_said_when_a_session_goes_on(tmp_path: Path) -> None:
    with at_the_station(tmp_path, SessionDetails(operator="bob", ambient_temp_c=20.0)) as (station, _):
        station.send(Quit())
        station.run()
    with at_the_station(tmp_path, SessionDetails(operator="ann", ambient_temp_c=20.4)) as (station, board):
        station.send(Quit())
        station.run()
    assert [message.text for message in board.messages][:2] == ["noted: operator from here on: ann", "noted: 20.4 °C"]
    session = read_session(tmp_path / "session")
    assert (session.operator, session.ambient_temp_c) == ("bob", 20.0)
    assert [(note.text, note.ambient_temp_c) for note in session.notes] == [
        ("operator from here on: ann", None),
        ("", 20.4),
    ]


@contextmanager
def at_the_station(folder: Path, details: SessionDetails) -> Iterator[tuple[Station, Board]]:
    machine = read_machine(FIXTURES / "machines" / "reference.yaml")
    plan = read_inline_plan(PLANS / "ten-minute-check.yaml")
    workplace = assemble(Job(machine, plan, folder / "session", details), SimpleNamespace(drain=list))
    board = Board()
    workplace.station.subscribe(board.take)
    try:
        yield workplace.station, board
    finally:
        workplace.close()


def test_an_operator_in_trouble_reads_the_shops_own_text_and_no_command() -> None:
    error = InstrumentError("no answer", where="COM3", remedy="`dbbstation instrument ports` lists the ports")
    board = Happening().board()
    board.take(Fault(error, None))
    said = now_for_operator(board, "Do not cut, call 4711.")
    assert said == "FAULT at COM3: no answer. Then C connects again, Q leaves. Do not cut, call 4711."
    assert "`dbbstation instrument ports`" in sentence_now(board)


@pytest.mark.usefixtures("copied_works")
def test_a_jobs_report_has_the_shops_letterhead_and_the_jobs_tolerances(job_file: Path) -> None:
    folder = job_file.parent
    session = shutil.copytree(FIXTURES / "sessions" / "virtual", folder / "monday-2026-11-20")
    text = "format: dbb-settings/1\nreport: {laboratory: Example Metrology}\ntolerances: [{quantity: circular-deviation, largest: 1, unit: µm}]\n"
    (folder / "dbbstation-settings.yaml").write_text(text, encoding="utf-8")
    job_file.write_text(job_file.read_text(encoding="utf-8") + "place: hall 3\n", encoding="utf-8")
    answer = JobAnswer(read_operated(job_file), session, ())
    until = time.monotonic() + 120.0
    while (found := answer.look()) is None and time.monotonic() < until:
        time.sleep(0.1)
    answer.close()
    assert found is not None
    assert found.word is Conformity.WITHIN  # 400 µm by the job, 1 µm by the shop
    assert found.report is not None
    page = found.report.read_text(encoding="utf-8")
    assert "Measured by Example Metrology. hall 3" in page
    assert any(line.startswith("Circular deviation: ") and "limit 400 µm, margin" in line for line in found.reasons)


def test_an_operator_goes_back_to_a_test() -> None:
    happening = Happening().circle("t0", Direction.CCW).command(Accept())
    runner = Waits(happening.events)
    app = StationApp(happening.shown(), runner, clock=lambda: 0.0)

    async def run() -> None:
        async with app.run_test(size=(80, 24)) as pilot:
            await app.push_screen(OperateScreen(app, happening.shown()))
            app.look()
            await pilot.pause()
            await pilot.press("o")
            assert isinstance(app.screen, OverviewScreen)
            await pilot.press("up", "up", "left", "enter")
            assert isinstance(app.screen, OperateScreen)

    asyncio.run(run())
    assert runner.sent == [GoTo("t0", Direction.CCW)]


def test_a_limit_changed_within_a_session_is_said_and_noted(job_file: Path) -> None:
    session = shutil.copytree(FIXTURES / "sessions" / "virtual", job_file.parent / "monday-2026-11-20")
    read_operated(job_file).tolerances_file(session)  # as it is written when the session begins
    job_file.write_text(job_file.read_text(encoding="utf-8").replace("largest: 400", "largest: 500"), encoding="utf-8")
    answered = JobAnswer(read_operated(job_file), session, (), Reported).look()
    assert answered is not None
    assert answered.reasons[0].startswith("The limits of the job were changed during this session")
    assert "largest: 400" in read_session(session).notes[-1].text
