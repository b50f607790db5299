"""The app on a sequence that is only made up."""

from __future__ import annotations

import asyncio
import shutil
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from textual.events import Key
from textual.widgets import Input, Static

from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.session import read_session
from dbbstation.files.recordings.session_writer import SessionWriter
from dbbstation.plan.plan import Direction
from dbbstation.quality.finding import Name, found
from dbbstation.report.conditions import conditions
from dbbstation.service.live_trace import LiveTrace
from dbbstation.station.commands import Accept, AddNote, GoTo, Judge, Quit, Repeat, Skip
from dbbstation.station.states import State
from dbbstation.tui.app import StationApp
from dbbstation.tui.help_screen import HELP
from dbbstation.tui.large_screen import LargeFigures, LargeScreen
from dbbstation.tui.measure_screen import MeasureScreen
from dbbstation.tui.messages_screen import MessagesScreen
from dbbstation.tui.overview_panels import ChosenRun
from dbbstation.tui.overview_screen import OverviewScreen
from dbbstation.tui.questions import GiveUpQuestion, ReasonQuestion, TemperatureQuestion, TypeQuestion, YesQuestion
from dbbstation.tui.results_screen import ResultsScreen
from dbbstation.tui.run_list import FindingsPanel
from dbbstation.tui.trace_view import _LAST, TraceView
from tests.tui.happenings import Happening, make_plan

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from textual.pilot import Pilot

    from dbbstation.service.board import SequenceOpened
    from dbbstation.station.commands import Command
    from dbbstation.station.events import Event


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Results are written beside the session, which is made up: not into the checkout."""
    monkeypatch.chdir(tmp_path)


class EndsWhileItsMailIsTaken:
    """A sequence that, told to quit, sends its last events just after the mailbox was emptied, and is over."""

    crash: Exception | None = None

    def __init__(self, before: list[Event | SequenceOpened], last: list[Event | SequenceOpened]) -> None:
        self.alive = True
        self._mail = before
        self._last = last
        self._quits = False

    def start(self) -> None:
        """Do nothing."""

    def wait(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def send(self, command: Command) -> bool:
        self._quits = self._quits or isinstance(command, Quit)
        return True

    def mail(self) -> list[Event | SequenceOpened]:
        came, self._mail = self._mail, []
        if self._quits and self.alive:
            self._mail, self.alive = self._last, False
        return came


def test_what_a_sequence_says_last_is_shown_before_the_screen_closes() -> None:
    happening = Happening()
    told = len(happening.events)
    happening.command(Quit())
    runner = EndsWhileItsMailIsTaken(list(happening.events[:told]), list(happening.events[told:]))
    app = StationApp(happening.shown(), runner, clock=lambda: 0.0)

    async def quit_it() -> None:
        async with app.run_test() as pilot:
            app.look()
            assert app.board.state is State.ANNOUNCED
            app.leave(sure=True)
            for _ in range(200):  # a busy computer looks late
                if not app.is_running or app.board.state is State.STOPPED:
                    break
                await pilot.pause(0.05)

    asyncio.run(quit_it())
    assert app.board.state is State.STOPPED


class Waits:
    """A sequence that waits for ever where it stands, and notes what it is told."""

    alive = True
    crash: Exception | None = None

    def __init__(self, events: list[Event | SequenceOpened]) -> None:
        self.sent: list[Command] = []
        self._mail = list(events)

    def start(self) -> None:
        """Do nothing."""

    def wait(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def send(self, command: Command) -> bool:
        self.sent.append(command)
        return True

    def post(self, events: list[Event | SequenceOpened]) -> None:
        self._mail += events

    def mail(self) -> list[Event | SequenceOpened]:
        came, self._mail = self._mail, []
        return came


def announced() -> Happening:
    return Happening()


def turning() -> Happening:
    return Happening().circle("t0", Direction.CCW, share=0.5)


def complete() -> Happening:
    return Happening().circle("t0", Direction.CCW)


def finished() -> Happening:
    happening = Happening(make_plan(tests=1))
    for direction in (Direction.CCW, Direction.CW):
        happening.circle("t0", direction).command(Accept())
    return happening


STATES = [announced, turning, complete, finished]


def played(
    happening: Happening,
    play: Callable[[Pilot[None], StationApp], Awaitable[None]],
    size: tuple[int, int] = (80, 24),
) -> Waits:
    runner = Waits(happening.events)
    app = StationApp(happening.shown(), runner, clock=lambda: 0.0)

    async def run() -> None:
        async with app.run_test(size=size) as pilot:
            app.look()
            await pilot.pause()
            await play(pilot, app)

    asyncio.run(run())
    return runner


@pytest.mark.parametrize(("screen", "key"), [("measure", ""), ("large", "f"), ("overview", "o")])
def test_every_key_of_a_screen_has_its_sentence_and_every_sentence_its_key(screen: str, key: str) -> None:
    async def play(pilot: Pilot[None], app: StationApp) -> None:
        if key:
            await pilot.press(key)
        assert app.drawn is not None
        assert app.drawn.help_name == screen
        bound = {one for each in (app.drawn, app) for one in each._bindings.key_to_bindings}
        explained = {**HELP["everywhere"].keys, **HELP[screen].keys}
        unseen = {"ctrl+c", "ctrl+q", "tab", "shift+tab", "super+c"}  # quits as Q does; moves a focus that nothing has
        assert bound - unseen - set(explained) == set()
        assert set(explained) - bound - {"ctrl+p"} == set()
        assert all(sentence.endswith(".") for sentence in explained.values())

    played(announced(), play)


@pytest.mark.parametrize("state", STATES)
def test_the_palette_offers_what_keys_do_now_and_does_the_same(state: Callable[[], Happening]) -> None:
    async def offered(pilot: Pilot[None], app: StationApp) -> None:
        commands = {one.title: one for one in app.get_system_commands(app.screen)}
        footer = {
            one.binding.description for one in app.screen.active_bindings.values() if one.enabled and one.binding.show
        }
        assert footer <= set(commands)
        explained = {**HELP["everywhere"].keys, **HELP["measure"].keys}
        assert {one.help for one in commands.values()} <= set(explained.values())
        commands["Tests"].callback()
        await pilot.pause()
        assert isinstance(app.screen, OverviewScreen)

    played(state(), offered)


def test_a_command_of_the_palette_is_sent_as_by_its_key() -> None:
    async def by_key(pilot: Pilot[None], _app: StationApp) -> None:
        await pilot.press("s")

    async def by_name(pilot: Pilot[None], app: StationApp) -> None:
        next(one for one in app.get_system_commands(app.screen) if one.title == "Skip").callback()
        await pilot.pause()

    assert played(announced(), by_key).sent == played(announced(), by_name).sent == [Skip()]


def test_the_bell_rings_once_when_a_run_waits_for_its_verdict(monkeypatch: pytest.MonkeyPatch) -> None:
    rung = []
    monkeypatch.setattr(StationApp, "bell", lambda _self: rung.append(1))

    async def look_again(pilot: Pilot[None], app: StationApp) -> None:
        app.look()
        app.look()
        await pilot.pause()

    played(announced(), look_again)
    played(turning(), look_again)
    assert rung == []
    played(complete(), look_again)
    assert rung == [1]


def test_a_reason_is_typed_and_an_empty_one_is_none() -> None:
    async def play(pilot: Pilot[None], app: StationApp) -> None:
        await pilot.press("o", "up", "left", "x")
        assert isinstance(app.screen, ReasonQuestion)
        await pilot.press("5", "enter")
        assert isinstance(app.screen, ReasonQuestion)
        await pilot.press(*"a chip", "enter")
        assert isinstance(app.screen, OverviewScreen)

    happening = complete().command(Accept())
    (judged,) = played(happening, play).sent
    assert isinstance(judged, Judge)
    assert (judged.reason, judged.accepted) == ("a chip", False)


def test_a_question_goes_with_the_circle_that_it_is_about() -> None:
    happening = complete()
    turning_at = happening.states().index(State.TURNING) + 1
    runner = Waits(happening.events[:turning_at])
    app = StationApp(happening.shown(), runner, clock=lambda: 0.0)

    async def run() -> None:
        async with app.run_test(size=(80, 24)) as pilot:
            app.look()
            await pilot.press("q")
            assert isinstance(app.screen, GiveUpQuestion)
            runner.post(happening.events[turning_at:])
            app.look()
            await pilot.pause()
            assert app.board.state is State.COMPLETE
            assert len(app.screen_stack) == 1
            await pilot.press("g")
            assert "centred" in app.screen.query_one(TraceView)._caption()

    asyncio.run(run())
    assert runner.sent == []


def test_a_key_that_comes_while_the_screens_close_is_harmless() -> None:
    runner = Waits(announced().events)
    app = StationApp(announced().shown(), runner, clock=lambda: 0.0)

    async def run() -> None:
        async with app.run_test(size=(80, 24)) as pilot:
            app.look()
            await pilot.pause()
            taken_down = list(app._screen_stack)
            app._screen_stack.clear()
            await app.on_event(Key("v", "v"))
            app._screen_stack.extend(taken_down)

    asyncio.run(run())


def twice() -> Happening:
    happening = Happening().circle("t0", Direction.CCW).command(Repeat("the bar slipped"))
    return happening.circle("t0", Direction.CCW).command(Accept())


def test_a_rejected_run_before_the_last_is_seen_and_counts_again() -> None:
    async def play(pilot: Pilot[None], app: StationApp) -> None:
        await pilot.press("o", "left")
        chosen = app.screen.query_one(ChosenRun)
        assert str(chosen.text(app.board)).startswith("t0-ccw-2: centre")
        await pilot.press("a")  # it counts already
        await pilot.press("h")
        figures, verdict, which = str(chosen.text(app.board)).splitlines()
        assert figures.startswith("t0-ccw-1: centre X +10.8 Y +16.8")  # 20 µm towards 1 rad
        assert verdict == "rejected: the bar slipped"
        assert which.startswith("Run 1 of 2")
        await pilot.press("x")  # it does not count already
        assert isinstance(app.screen, OverviewScreen)
        await pilot.press("a", "h", "x", "1")

    again, taken_back = played(twice(), play).sent
    assert again == Judge("t0", Direction.CCW, 1, accepted=True, reason="")
    assert (taken_back.repeat, taken_back.accepted) == (2, False)


def test_large_figures_are_one_key_from_the_overview_once_a_question_is_closed() -> None:
    async def play(pilot: Pilot[None], app: StationApp) -> None:
        await pilot.press("o", "up", "left", "h", "h", "x")
        assert isinstance(app.screen, ReasonQuestion)
        await pilot.press("f")
        assert isinstance(app.screen, ReasonQuestion)
        await pilot.press("escape", "f")
        assert isinstance(app.screen, LargeScreen)
        await pilot.press("o", "f")  # lies beneath the overview already
        assert isinstance(app.screen, LargeScreen)
        assert len(app.screen_stack) == 2
        await pilot.press("f")
        assert isinstance(app.screen, MeasureScreen)

    assert played(twice(), play).sent == []


def test_views_are_those_there_is_something_for() -> None:
    async def views(pilot: Pilot[None], app: StationApp) -> list[str]:
        seen = []
        for _ in range(4):
            seen.append(app.screen.query_one(TraceView)._caption().split(" · ")[0])
            await pilot.press("g")
        return seen

    async def running(pilot: Pilot[None], app: StationApp) -> None:
        assert await views(pilot, app) == ["t0 ccw"] * 4

    async def one(pilot: Pilot[None], app: StationApp) -> None:
        assert await views(pilot, app) == ["t0 ccw", "t0 ccw centred"] * 2

    async def both(pilot: Pilot[None], app: StationApp) -> None:
        assert await views(pilot, app) == ["t0 ccw+cw", "t0 ccw+cw centred", "t0 ccw − cw centred", "t0 ccw+cw"]

    played(turning(), running)
    played(complete(), one)
    played(complete().command(Accept()).circle("t0", Direction.CW), both)


KEYS = (
    *"abcdefghijklmnopqrstuvwxyz0123456789?",
    "enter",
    "escape",
    "up",
    "down",
    "left",
    "right",
    "tab",
    "f1",
    "ctrl+c",
)


@settings(max_examples=12, deadline=None)
@given(state=st.sampled_from(STATES), keys=st.lists(st.sampled_from(KEYS), max_size=12))
def test_wrong_keys_do_no_harm_on_any_screen(state: Callable[[], Happening], keys: list[str]) -> None:
    async def play(pilot: Pilot[None], app: StationApp) -> None:
        for key in keys:
            if app.is_running:
                await pilot.press(key)
        assert app._exception is None

    happening = state()
    sent = played(happening, play).sent
    # Nothing is sent that means nothing to the sequence now; a quit goes through in every state.
    assert {type(command) for command in sent} <= {*happening.board().allowed, Quit, Judge, GoTo}


async def type_into(pilot: Pilot[None], app: StationApp, text: str) -> None:
    assert isinstance(app.screen, TemperatureQuestion)
    app.screen.query_one(Input).value = text
    await pilot.press("enter")
    await pilot.pause()


def test_the_temperature_of_the_shop_is_noted_at_any_time() -> None:
    async def play(pilot: Pilot[None], app: StationApp) -> None:
        await pilot.press("t")
        await type_into(pilot, app, "warm")
        assert "warm is no temperature" in str(app.screen.query_one(Static).visual)
        await type_into(pilot, app, "20,9")
        assert not isinstance(app.screen, TemperatureQuestion)

    assert played(announced(), play).sent == [AddNote(ambient_temp_c=20.9)]


def test_the_temperature_after_circles_is_asked_for_before_the_session_is_left() -> None:
    async def noted(pilot: Pilot[None], app: StationApp) -> None:
        await pilot.press("q")
        await type_into(pilot, app, "21")

    async def without(pilot: Pilot[None], app: StationApp) -> None:
        await pilot.press("q")
        assert isinstance(app.screen, TemperatureQuestion)
        await pilot.press("escape")  # left without consequence
        await pilot.press("q", "enter")

    async def not_asked(pilot: Pilot[None], _app: StationApp) -> None:
        await pilot.press("q")

    after_a_circle = complete().command(Accept())
    assert played(after_a_circle, noted).sent == [AddNote(ambient_temp_c=21.0), Quit()]
    assert played(complete().command(Accept()), without).sent == [Quit()]
    assert played(announced(), not_asked).sent == [Quit()]
    # Somebody noted it behind the last circle.
    assert played(complete().command(Accept(), AddNote(ambient_temp_c=20.5)), not_asked).sent == [Quit()]
    assert Quit() in played(complete().command(AddNote("a chip")), without).sent


def test_a_question_that_is_about_no_circle_stays_while_the_station_speaks() -> None:
    async def play(pilot: Pilot[None], app: StationApp) -> None:
        app.push_screen(YesQuestion("End it and go back?"))
        await pilot.pause()
        app.look()
        await pilot.pause()
        assert isinstance(app.screen, YesQuestion)
        await pilot.press("escape")
        assert not isinstance(app.screen, YesQuestion)

    assert played(announced(), play).sent == []


def test_a_note_has_its_key_and_can_be_left() -> None:
    async def play(pilot: Pilot[None], app: StationApp) -> None:
        await pilot.press("plus", *"no", "escape")
        assert not isinstance(app.screen, TypeQuestion)
        await pilot.press("plus")
        await pilot.press(*"no_coolant", "enter")

    assert played(announced(), play).sent == [AddNote("no_coolant")]


def test_behind_the_last_circle_it_is_written_into_the_session(tmp_path: Path) -> None:
    folder = tmp_path / "session"
    shutil.copytree(shipped_folder("fixtures") / "sessions" / "logged", folder)
    happening = finished()
    opened = replace(happening.events[0], session=str(folder))

    async def play(pilot: Pilot[None], app: StationApp) -> None:
        await pilot.press("e")
        await type_into(pilot, app, "20.9")
        while not isinstance(app.screen, ResultsScreen):
            await pilot.pause(0.02)
            app.look()
        assert not app.board.temperature_due

    happening.events[0] = opened
    assert played(happening, play).sent == []
    session = read_session(folder)
    assert [note.ambient_temp_c for note in session.notes] == [20.1, 20.9]
    assert dict(conditions(session, [], ""))["temperature of the shop"] == "20.4 °C before, 20.9 °C after"


@pytest.mark.parametrize(("happening", "shown"), [(complete, False), (finished, True)])
def test_the_footer_names_results_when_the_plan_is_through(
    tmp_path: Path, happening: Callable[[], Happening], *, shown: bool
) -> None:
    folder = tmp_path / "session"
    shutil.copytree(shipped_folder("fixtures") / "sessions" / "logged", folder)
    happens = happening()
    happens.events[0] = replace(happens.events[0], session=str(folder))
    found: list[bool] = []

    async def play(pilot: Pilot[None], app: StationApp) -> None:
        await pilot.pause()
        found.append(any(key == "e" and one.binding.show for key, one in app.screen.active_bindings.items()))

    played(happens, play)
    assert found == [shown]


def test_a_session_that_another_process_writes_into_says_so_and_can_be_left(tmp_path: Path) -> None:
    folder = tmp_path / "session"
    shutil.copytree(shipped_folder("fixtures") / "sessions" / "logged", folder)
    happening = finished()
    happening.events[0] = replace(happening.events[0], session=str(folder))

    async def play(pilot: Pilot[None], app: StationApp) -> None:
        await pilot.press("q")
        await type_into(pilot, app, "20.9")
        while not any("writes into this session" in message.text for message in app.board.messages):
            await pilot.pause(0.02)
            app.look()
        await pilot.press("q")
        await pilot.press("enter")

    with SessionWriter.open(folder):
        assert played(happening, play).sent == [Quit()]
    assert [note.ambient_temp_c for note in read_session(folder).notes] == [20.1]


def test_the_session_before_is_drawn_dim_beneath_its_own_direction_and_test(monkeypatch: pytest.MonkeyPatch) -> None:
    happening = complete()
    former = happening.board().traces[Direction.CCW]
    before = LiveTrace(former.run, former.circle)
    before._append(former.theta_deg, former.deviation_um + 40.0)
    before.largest_um = former.largest_um + 40.0
    before.centre()
    asked = []

    def last(folder: Path, test: str) -> dict[Direction, LiveTrace]:
        asked.append((folder.name, test))
        return {Direction.CCW: before, Direction.CW: before}

    monkeypatch.setattr("dbbstation.tui.app.last_traces", last)

    async def play(pilot: Pilot[None], app: StationApp) -> None:
        while not app.board.last:
            app.look()
            await pilot.pause(0.02)
        app.look()
        view = app.screen.query_one(TraceView)
        assert view._beneath == {Direction.CCW: before}
        assert ((view._members & 30) == _LAST).sum() > 5  # alone in a cell, or on the scale
        assert view._legend(view.size.width).text.strip() == "━━ ccw  ── cw  ── before  ·· nominal"
        await pilot.press("g")
        assert view._beneath == {Direction.CCW: before.centred}
        app.board.last = {Direction.CCW: LiveTrace(replace(former.run, test="another"), former.circle)}
        app.draw()
        assert view._beneath == {}
        assert not (view._members & _LAST).any()

    played(happening, play)
    assert asked == [("session-7", former.run.test)]


def wrong() -> Happening:
    told = (
        found(Name.OTHER_DIRECTION, 144.7, 3.2, "sound", "something moved"),
        found(Name.FEED, 100.0, 10.0, "sound", "the feed", "feed 1100 of 1000 mm/min"),
    )
    return Happening(findings=told).circle("t0", Direction.CCW)


def test_what_is_wrong_is_not_accepted_by_enter_and_for_a_reason_only() -> None:
    async def play(pilot: Pilot[None], app: StationApp) -> None:
        said = " ".join(str(app.screen.query_one("#now").visual).split())
        assert said.startswith("REPEAT t0-ccw-1: feed 1100 of 1000 mm/min: set the override on the control to 100 %")
        rows = str(app.screen.query_one(FindingsPanel).text(app.board)).splitlines()
        assert rows[0].strip() == "REPEAT"
        assert [row.split()[0] for row in rows[1:]] == ["feed", "other"]
        assert "direction  " in rows[2]  # name and number do not run together
        await pilot.press("f")
        assert "██" in str(app.screen.query_one(LargeFigures).text(app.board))
        await pilot.press("f", "j")
        assert isinstance(app.screen, MessagesScreen)
        await pilot.press("escape", "a")
        assert isinstance(app.screen, ReasonQuestion)
        await pilot.press("escape", "enter", "a", "1")

    repeated, accepted = played(wrong(), play, size=(120, 40)).sent
    assert repeated == Repeat()
    assert accepted == Accept("the cause is known and does not touch what is wanted")
    # A sound one: Enter accepts it.
    sound = (found(Name.CLOSURE, 0.1, 1.0, "", ""),)  # the rest is for later circles to show

    async def enter(pilot: Pilot[None], _app: StationApp) -> None:
        await pilot.press("enter")

    assert played(Happening(findings=sound).circle("t0", Direction.CCW), enter).sent == [Accept()]


def test_what_was_found_is_the_reason_of_a_repeat_and_of_what_counts_all_the_same() -> None:
    for command, says in (
        (Repeat(), "feed wrong, 100.00 of 10.00 mm/min"),
        (Accept(), "accepted although other direction wrong, 144.70 of 3.20 µm; feed wrong, 100.00 of 10.00 mm/min"),
        (Repeat("the bar slipped"), "the bar slipped"),
        (Accept("it cannot be measured again"), "it cannot be measured again"),
    ):
        board = wrong().command(command).board()
        assert says in board.reasons["t0-ccw-1"]
    assert complete().command(Accept()).board().reasons["t0-ccw-1"] == ""
    assert complete().command(Repeat()).board().reasons["t0-ccw-1"] == "repeated by the operator"


def test_a_verdict_can_be_changed_when_the_plan_is_through(tmp_path: Path) -> None:
    session = shutil.copytree(shipped_folder("fixtures") / "sessions" / "virtual", tmp_path / "session")
    happening = complete().command(Accept())
    for command in (Skip(),) * 5:
        happening.command(command)
    begun: list[bool] = []

    async def play(pilot: Pilot[None], app: StationApp) -> None:
        assert app.board.state is State.FINISHED
        app.board.session = str(session)
        app._runner.start = lambda: begun.append(True)
        await pilot.press("o", "up", "up", "left", "x")
        assert isinstance(app.screen, ReasonQuestion)
        await pilot.press("escape")
        app.send(Judge("a", Direction.CW, 1, accepted=False, reason="the bar slipped"))
        for _ in range(200):
            app.look()
            if begun:
                break
            await pilot.pause(0.02)

    assert played(happening, play).sent == []
    assert begun == [True]  # the sequence goes on, with what does not count any more left to do
    assert read_session(session).runs[1].reason == "the bar slipped"
