"""A whole session by keys alone: from the start screen over the checklist and the circles to the path of the report."""

from __future__ import annotations

import asyncio
import hashlib
import shutil
import threading
import time
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from textual.widgets import OptionList, Static

from dbbstation.errors import InstrumentError
from dbbstation.files.formats.session import RunState
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.session import read_session
from dbbstation.instrument.library import at_rate, load_instrument
from dbbstation.plan.plan import Direction
from dbbstation.service.after import After
from dbbstation.service.choice import SetUpPart
from dbbstation.service.front import Front
from dbbstation.service.memory import Memory
from dbbstation.service.work import SessionTask, WorkProgress
from dbbstation.station.programs import RunProgram
from dbbstation.station.states import State
from dbbstation.tui.app import StationApp
from dbbstation.tui.help_screen import HelpScreen
from dbbstation.tui.measure_screen import MeasureScreen
from dbbstation.tui.new_screen import ROWS, NewScreen
from dbbstation.tui.prepare_screen import PrepareScreen
from dbbstation.tui.questions import ChooseQuestion, TemperatureQuestion, TypeQuestion, YesQuestion
from dbbstation.tui.results_screen import ResultsScreen
from dbbstation.tui.start_screen import StartScreen
from tests.tui.test_screen import accept, one_circle, press
from tests.virtual.faulty import FaultyInstrument as VirtualInstrument

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable
    from pathlib import Path

    from textual.pilot import Pilot

    from dbbstation.instrument.protocol import Protocol

    Play = Callable[[Pilot[None], StationApp], Awaitable[None]]

pytestmark = pytest.mark.usefixtures("copied_works")

PATIENCE_S = 60.0


def now(app: StationApp) -> str:
    return " ".join(str(app.screen.query_one("#row-now", Static).visual).split())


def rows(app: StationApp) -> list[str]:
    options = app.screen.query_one("#rows", OptionList)
    return [str(options.get_option_at_index(place).prompt) for place in range(options.option_count)]


def offered(app: StationApp) -> list[str]:
    options = app.screen.query_one(OptionList)
    return [str(options.get_option_at_index(place).prompt) for place in range(options.option_count)]


def below(app: StationApp) -> str:
    return " ".join(str(app.screen.query_one("#row-text", Static).visual).split())


async def until(_pilot: Pilot[None], condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s, "it did not happen in time"
        await asyncio.sleep(0.02)


def on(app: StationApp, kind: type) -> Callable[[], bool]:
    return lambda: isinstance(app.screen, kind) and app.screen.is_mounted


def play(front: Front, keys: Play, size: tuple[int, int] = (80, 24)) -> StationApp:
    app = StationApp(None, None, front=front)

    async def run() -> None:
        async with app.run_test(size=size) as pilot:
            await until_start(pilot, app)
            await keys(pilot, app)

    asyncio.run(run())
    return app


async def until_start(pilot: Pilot[None], app: StationApp) -> None:
    await until(pilot, lambda: isinstance(app.screen, StartScreen) and "Looking" not in now(app))


async def choose(pilot: Pilot[None], app: StationApp, part: SetUpPart, wanted: str) -> None:
    options = app.screen.query_one("#rows", OptionList)
    while options.highlighted != ROWS.index(part):
        await press(app, "down" if (options.highlighted or 0) < ROWS.index(part) else "up")
    await press(app, "enter")
    await until(pilot, on(app, ChooseQuestion))
    options = app.screen.query_one(OptionList)
    place = next(place for place, label in enumerate(offered(app)) if wanted in label)
    await until(pilot, lambda: options.highlighted is not None)
    while options.highlighted != place:
        await press(app, "down" if (options.highlighted or 0) < place else "up")
    # Without colours the mark alone says which one is chosen.
    await until(pilot, lambda: offered(app)[place].startswith("▸ "))
    await press(app, "enter")
    await until(pilot, on(app, NewScreen))


async def choose_all(pilot: Pilot[None], app: StationApp) -> None:
    await choose(pilot, app, SetUpPart.MACHINE, "reference.yaml")
    await choose(pilot, app, SetUpPart.PLAN, "three.yaml")
    await choose(pilot, app, SetUpPart.INSTRUMENT, "streaming-encoder ")
    await choose(pilot, app, SetUpPart.PORT, "10 times")
    await until(pilot, lambda: "is switched on when it is needed" in now(app))


async def confirm_all(pilot: Pilot[None], app: StationApp) -> None:
    await until(pilot, on(app, PrepareScreen))
    await press(app, "y", "b")
    await until(pilot, on(app, MeasureScreen))


async def answer_temperature(pilot: Pilot[None], app: StationApp, text: str) -> None:
    """Answer the question for the temperature after the circles; empty: go on without."""
    await until(pilot, lambda: isinstance(app.screen, TemperatureQuestion) and bool(app.screen.query("Input")))
    app.screen.query_one("Input").value = text
    await press(app, "enter")


async def measured(pilot: Pilot[None], app: StationApp, runs: int) -> None:
    while app.board.accepted < runs:
        await until(pilot, lambda: app.board.state is State.ANNOUNCED)
        await press(app, "enter")
        await until(pilot, lambda: app.board.state is State.COMPLETE)
        await accept(pilot, app)
        await until(pilot, lambda: app.board.state is not State.COMPLETE)


def slower(name: str, profile: str | None = None) -> Protocol:
    """The usual instrument at a rate that leaves the computer time: ten times real speed makes it ten times as much work."""
    protocol = load_instrument(name, profile)
    return at_rate(protocol, 50.0) if name == "streaming-encoder" else protocol


@pytest.fixture
def front(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Front:
    monkeypatch.setattr("dbbstation.service.memory.load_instrument", slower)
    shop = tmp_path / "shop"
    shop.mkdir()
    one_circle(shop, feed_mm_min=6000)
    text = (shipped_folder("protocols") / "plans" / "ten-minute-check.yaml").read_text("utf-8")
    fast = text.replace("feed_mm_min: 1000", "feed_mm_min: 6000").replace("overshoot_deg: 20", "overshoot_deg: 5")
    (shop / "three.yaml").write_text(fast.replace("[ccw, cw]", "[ccw]"), "utf-8")
    return Front(shop, Memory(tmp_path / "state" / "station.json"))


@pytest.mark.slow
def test_from_the_start_screen_to_the_path_of_the_report(front: Front) -> None:
    async def keys(pilot: Pilot[None], app: StationApp) -> None:
        assert "No session yet" in now(app)
        await press(app, "enter", "e", "i", "c")  # mean nothing here
        await press(app, "n")
        await until(pilot, on(app, NewScreen))
        assert "Still missing: the machine's file, the plan, the instrument, the port" in now(app)
        await press(app, "b", "l")  # nothing to begin with
        assert isinstance(app.screen, NewScreen)
        await choose_all(pilot, app)
        await press(app, "b")
        await until(pilot, on(app, PrepareScreen))
        assert "5 of 5" in now(app)
        await press(app, "b")  # not before everything is confirmed
        await press(app, "enter", "down", "enter", "enter")
        await until(pilot, lambda: "4 of 5" in now(app))
        await confirm_all(pilot, app)
        await measured(pilot, app, 3)
        await until(pilot, lambda: app.board.finished is not None)
        assert len(app.board.tasks) == 3
        await press(app, "e")
        await answer_temperature(pilot, app, "20.9")
        await until(pilot, on(app, ResultsScreen))
        await press(app, "3")  # there is no model yet
        await press(app, "1")
        after = app.screen._after
        await until(pilot, lambda: after.results[SessionTask.CALIBRATE].progress is WorkProgress.DONE)
        await press(app, "4")
        await until(pilot, lambda: after.results[SessionTask.REPORT].progress is WorkProgress.DONE)
        await until(pilot, lambda: "report.html" in str(app.screen.query_one("#row-text", Static).visual))
        assert "NO VERDICT" in below(app)
        await press(app, "escape")
        await until(pilot, on(app, MeasureScreen))
        await press(app, "q")
        await until_start(pilot, app)
        await until(pilot, lambda: len(rows(app)) == 1)
        assert all(word in rows(app)[0] for word in ("session", "complete"))
        await press(app, "q")
        await until(pilot, lambda: app._exit)

    play(front, keys)
    session = read_session(front.under / "session")
    runs = session.runs
    assert [note.ambient_temp_c for note in session.notes] == [20.9]
    assert [run.state for run in runs].count(RunState.ACCEPTED) == 3
    results = front.under / "session-results"
    assert {path.name for path in results.iterdir()} >= {"model.yaml", "report.html"}
    # The command that the model names is one that anybody can type.
    assert "dbbstation calibrate session" in (results / "model.yaml").read_text("utf-8")
    remembered = front.memory.read()
    assert next(iter(remembered.sessions)) == front.under / "session"
    assert remembered.line_of(front.under / "session").time_scale == 10.0
    # The next session is not offered at a virtual machine.
    assert not remembered.line.virtual


@pytest.mark.slow
def test_a_session_is_gone_on_with_where_it_was_left(front: Front) -> None:
    async def first(pilot: Pilot[None], app: StationApp) -> None:
        await press(app, "v")
        await until(pilot, on(app, NewScreen))
        await choose(pilot, app, SetUpPart.PLAN, "plan.yaml")
        await press(app, "b")
        await confirm_all(pilot, app)
        await measured(pilot, app, 1)
        await until(pilot, lambda: app.board.state is State.ANNOUNCED)
        await press(app, "q")
        await answer_temperature(pilot, app, "")
        await until_start(pilot, app)

    async def second(pilot: Pilot[None], app: StationApp) -> None:
        assert "1 of 2 runs" in rows(app)[0]
        await press(app, "enter")
        await until(pilot, on(app, PrepareScreen))
        assert "4 of 4" in now(app)
        assert "Left to do: 1 runs" in below(app)
        await press(app, "t")
        await answer_temperature(pilot, app, "21,5")
        await until(pilot, on(app, PrepareScreen))
        await until(pilot, lambda: "Temperature of the shop before: 21.5 °C." in below(app))
        await confirm_all(pilot, app)
        await until(pilot, lambda: app.board.state is State.ANNOUNCED)
        assert app.board.accepted == 1
        app.close_down()  # as a polite kill does: not back to the start screen, but to the end
        await until(pilot, lambda: app._exit)

    play(front, first)
    play(front, second)
    assert [note.ambient_temp_c for note in read_session(front.under / "virtual").notes] == [21.5]


def test_every_key_goes_back_and_wrong_ones_do_nothing(front: Front) -> None:
    async def keys(pilot: Pilot[None], app: StationApp) -> None:
        await press(app, "x", "o", "f", "1", "space", "left", "delete")
        assert isinstance(app.screen, StartScreen)
        await press(app, "f1")
        await until(pilot, on(app, HelpScreen))
        await press(app, "escape")
        await press(app, "n")
        await until(pilot, on(app, NewScreen))
        await press(app, "o", "f", "e", "x", "a")
        assert isinstance(app.screen, NewScreen)
        await press(app, "enter")
        await until(pilot, on(app, ChooseQuestion))
        await press(app, "escape")
        await until(pilot, on(app, NewScreen))
        at = app.screen.query_one("#rows", OptionList)
        while at.highlighted != ROWS.index(SetUpPart.TEMPERATURE):
            await press(app, "up" if (at.highlighted or 0) > ROWS.index(SetUpPart.TEMPERATURE) else "down")
        for typed, said in (("warm", "warm is no temperature"), ("20,5", "Still missing")):
            await press(app, "enter")
            await until(pilot, on(app, TypeQuestion))
            app.screen.query_one("Input").value = typed
            await press(app, "enter")
            await until(pilot, on(app, NewScreen))
            await until(pilot, lambda said=said: said in now(app))
        assert any("20.5 °C" in row for row in rows(app))
        await press(app, "delete")
        await until(pilot, lambda: not any("20.5 °C" in row for row in rows(app)))
        await press(app, "q")
        await until_start(pilot, app)

    play(front, keys)


def test_what_a_file_lacks_is_said_and_nothing_is_opened(front: Front) -> None:
    far = front.under / "far.yaml"
    far.write_text((front.under / "plan.yaml").read_text("utf-8").replace("[0, 0, -1150]", "[900, 0, -1150]"), "utf-8")

    async def keys(pilot: Pilot[None], app: StationApp) -> None:
        await press(app, "v")
        await until(pilot, on(app, NewScreen))
        await choose(pilot, app, SetUpPart.PLAN, "far.yaml")
        await press(app, "b")
        await until(pilot, lambda: "test low ccw" in now(app))
        assert isinstance(app.screen, NewScreen)

    play(front, keys)
    assert not (front.under / "virtual").exists()


def test_a_port_that_does_not_answer_says_so(front: Front) -> None:
    async def keys(pilot: Pilot[None], app: StationApp) -> None:
        await press(app, "n")
        await until(pilot, on(app, NewScreen))
        app.screen._line(instrument="heidenhain-nd281b", port="/dev/no-such-port")
        await press(app, "l")
        await until(pilot, lambda: "there is no such port" in now(app))

    play(front, keys)


def test_the_checklist_shows_what_the_instrument_reads(front: Front) -> None:
    protocol = load_instrument("streaming-encoder")
    length_mm: list[float | None] = [None]

    with VirtualInstrument(protocol, lambda _t_s: length_mm[0]) as wire:

        async def keys(pilot: Pilot[None], app: StationApp) -> None:
            await press(app, "v")
            await until(pilot, on(app, NewScreen))
            app.screen._line(instrument="streaming-encoder", port=wire.port)
            app.screen._take(bar_waiver="a test")
            await press(app, "b")
            await until(pilot, on(app, PrepareScreen))
            await until(pilot, lambda: "no bar" in below(app))
            length_mm[0] = 147.1
            await until(pilot, lambda: "reads 147.1000 mm" in below(app) and "4.4 mm short of feed-in" in below(app))
            length_mm[0] = 151.5
            await until(pilot, lambda: "for the first circle the bar is seated" in below(app))
            wire.hang_up()
            await until(pilot, lambda: "opened again every 2 s" in below(app))
            await press(app, "escape")
            await until(pilot, on(app, NewScreen))
            await press(app, "escape")
            await until_start(pilot, app)
            await until(pilot, lambda: not [one for one in threading.enumerate() if one.name == f"hold {wire.port}"])

        play(front, keys)


def test_work_can_be_ended_and_leaving_it_asks_first(front: Front) -> None:
    async def keys(pilot: Pilot[None], app: StationApp) -> None:
        await press(app, "e")
        await until(pilot, on(app, ResultsScreen))
        after = app.screen._after
        await press(app, "2")
        await until(pilot, lambda: after.busy is SessionTask.DIAGNOSE)
        await press(app, "k")
        await until(pilot, lambda: after.results[SessionTask.DIAGNOSE].progress is WorkProgress.CANCELLED)
        await until(pilot, lambda: "ended" in rows(app)[1])
        await press(app, "2")
        await until(pilot, lambda: after.busy is SessionTask.DIAGNOSE)
        await press(app, "escape")
        await until(pilot, on(app, YesQuestion))
        await press(app, "n")
        await until(pilot, on(app, ResultsScreen))
        assert after.busy is SessionTask.DIAGNOSE
        await press(app, "escape")
        await until(pilot, on(app, YesQuestion))
        await press(app, "y")
        await until_start(pilot, app)

    shutil.copytree(shipped_folder("fixtures") / "sessions" / "small", front.under / "small")
    play(front, keys)
    assert not list((front.under / "small-results").iterdir())


def test_circles_are_drawn_and_the_history_is_told_from_the_screen(front: Front) -> None:
    session = shutil.copytree(shipped_folder("fixtures") / "sessions" / "small", front.under / "small")

    async def keys(pilot: Pilot[None], app: StationApp) -> None:
        await press(app, "e")
        await until(pilot, on(app, ResultsScreen))
        after = app.screen._after
        await press(app, "6")
        await until(pilot, lambda: after.results[SessionTask.FIGURES].progress is WorkProgress.DONE)
        assert "circles are drawn." in below(app)
        await press(app, "7")
        await until(pilot, lambda: after.results[SessionTask.HISTORY].progress is WorkProgress.DONE)
        assert "PM600-0007: Cannot tell whether anything changed" in below(app)
        await press(app, "escape")

    play(front, keys)
    results = session.with_name("small-results")
    assert (results / "circles.pdf").read_bytes().startswith(b"%PDF")
    assert "<svg" in (results / "history.html").read_text("utf-8")
    # Other sessions change the history, and none of them the drawing.
    again = After(session)
    assert again.results[SessionTask.FIGURES].progress is WorkProgress.DONE
    assert again.results[SessionTask.HISTORY].progress is None


def test_an_error_of_the_virtual_machine_stays_on_the_screen(front: Front, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuses(*_: object, **__: object) -> None:
        raise InstrumentError("no pseudo-terminal is left", where="here", remedy="close another program")

    monkeypatch.setattr("dbbstation.service.front.virtual_place", refuses)

    async def keys(pilot: Pilot[None], app: StationApp) -> None:
        await press(app, "v")
        await until(pilot, on(app, NewScreen))
        await press(app, "b")
        await until(pilot, on(app, PrepareScreen))
        await press(app, "y", "b")
        await until(pilot, lambda: "no pseudo-terminal is left" in now(app))
        assert isinstance(app.screen, PrepareScreen)

    play(front, keys)


def test_compensated_programs_are_written_and_command_the_session(front: Front) -> None:
    small = shipped_folder("fixtures") / "sessions" / "small"
    shutil.copy(shipped_folder("fixtures") / "models" / "small.yaml", front.under / "model.yaml")
    # A control that plans 1 m/s² cannot keep the plan's 6000 mm/min in compensated pieces: such programs are refused.
    plan = front.under / "plan.yaml"
    plan.write_text(plan.read_text("utf-8").replace("feed_mm_min: 6000", "feed_mm_min: 1000"), "utf-8")

    async def keys(pilot: Pilot[None], app: StationApp) -> None:
        await press(app, "v")
        await until(pilot, on(app, NewScreen))
        app.screen._take(machine=small / "machine.yaml", plan=front.under / "plan.yaml")
        await press(app, "b")
        await until(pilot, on(app, PrepareScreen))
        assert "plain circles" in below(app)
        await press(app, "w")
        await until(pilot, on(app, ChooseQuestion))
        assert [label.strip("▸ ").split()[0] for label in offered(app)] == ["nominal:", "compensated"]
        await press(app, "escape")
        await until(pilot, on(app, PrepareScreen))
        await press(app, "w")
        await until(pilot, on(app, ChooseQuestion))
        await press(app, "down", "enter")
        await until(pilot, lambda: isinstance(app.screen, PrepareScreen) and "compensated with" in below(app))
        digest = hashlib.sha256((front.under / "model.yaml").read_bytes()).hexdigest()
        assert f"2 NC programs run the circles that they are named after, compensated with the model {digest[:12]}" in (
            below(app)
        )
        programs = app.screen._prepared.job.programs.values()
        assert {program.model_sha256 for program in programs} == {digest}
        await press(app, "escape")
        await until(pilot, on(app, NewScreen))
        assert any("virtual-programs" in row for row in rows(app))

    play(front, keys)


def test_a_session_under_programs_is_offered_no_others(front: Front) -> None:
    choice = replace(front.virtual_choice(), plan=front.under / "plan.yaml")
    plain = front.prepare(choice)
    programs = {("low", Direction.CCW): RunProgram("low-ccw.ngc", b"", "")}
    prepared = replace(plain, job=replace(plain.job, programs=programs))

    async def keys(_pilot: Pilot[None], app: StationApp) -> None:
        screen = PrepareScreen(app, front, choice, prepared)
        screen._goes_on = True
        await app.push_screen(screen)
        await press(app, "w")
        assert app.screen is screen
        assert not app._works

    play(front, keys)
