"""The screen, pressed by a pilot, through whole plans against the virtual machine on a real line."""

from __future__ import annotations

import asyncio
import time
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING
from unittest import mock

import pytest
from textual.events import Key
from textual.widgets import Input

from dbbstation.errors import InstrumentError
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import PlanFile, read_inline_plan
from dbbstation.files.formats.session import RunState
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.session import read_session
from dbbstation.instrument.library import load_instrument
from dbbstation.plan.plan import Direction
from dbbstation.service.held_line import HeldLine
from dbbstation.service.runner import Runner, opener
from dbbstation.service.virtual_place import VirtualPlace, virtual_place
from dbbstation.station.assembly import Job
from dbbstation.station.events import Event, FeedInSeen, Observer
from dbbstation.station.states import State
from dbbstation.tui.app import StationApp
from dbbstation.tui.board_screen import Shown
from dbbstation.tui.help_screen import HelpScreen
from dbbstation.tui.large_screen import LargeScreen
from dbbstation.tui.overview_screen import OverviewScreen
from dbbstation.tui.questions import GiveUpQuestion, ReasonQuestion, TemperatureQuestion
from dbbstation.tui.trace_view import TraceView
from tests.virtual.faulty import FaultyInstrument

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Iterator
    from pathlib import Path

    from textual.pilot import Pilot

PATIENCE_S = 60.0
TIME_SCALE = 6.0
_SHIPPED = load_instrument("streaming-encoder")
# A busy computer may stand still for longer than an instrument is allowed to.
ENCODER = _SHIPPED.model_copy(update={"timing": _SHIPPED.timing.model_copy(update={"timeout_s": 3.0})})


@pytest.fixture
def short_plan(tmp_path: Path) -> PlanFile:
    return one_circle(tmp_path, feed_mm_min=6000)


@pytest.fixture
def slow_plan(tmp_path: Path) -> PlanFile:
    """The same, slow enough for what is pressed in the middle of it, however busy the computer."""
    return one_circle(tmp_path, feed_mm_min=500)


def one_circle(folder: Path, *, feed_mm_min: int) -> PlanFile:
    text = (shipped_folder("protocols") / "plans" / "ten-minute-check.yaml").read_text("utf-8")
    text = text.replace("feed_mm_min: 1000", f"feed_mm_min: {feed_mm_min}").replace(
        "overshoot_deg: 20", "overshoot_deg: 5"
    )
    file = folder / "plan.yaml"
    file.write_text(
        "".join(
            line for line in text.splitlines(keepends=True) if "name: side" not in line and "name: high" not in line
        ),
        "utf-8",
    )
    return read_inline_plan(file)


class Bench:
    """A virtual machine, a session folder and screens on them."""

    def __init__(self, place: VirtualPlace, job: Job) -> None:
        self.place = place
        self.job = job
        self.app: StationApp | None = None

    def press_all(
        self,
        play: Callable[[Pilot[None], StationApp], Awaitable[None]],
        size: tuple[int, int] = (80, 24),
        helper: Observer | None = None,
    ) -> None:
        line = HeldLine(ENCODER, self.place.port, clock=self.job.clock)
        runner = Runner(opener(self.job, line, observers=[helper or self.place.helper]), line)
        app = StationApp(
            Shown(self.job.plan.name, self.job.plan.plate.bores, tests=self.job.plan.to_domain().tests), runner
        )

        async def run() -> None:
            async with app.run_test(size=size) as pilot:
                await play(pilot, app)

        with closing(line):
            asyncio.run(run())
        assert not runner.alive
        if runner.crash is not None:
            raise runner.crash

    def states(self) -> list[tuple[str, RunState]]:
        return [(f"{run.test}-{run.direction}-{run.repeat}", run.state) for run in read_session(self.job.folder).runs]


@contextmanager
def switched_on(plan: PlanFile, folder: Path) -> Iterator[Bench]:
    machine = read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")
    with (
        mock.patch("dbbstation.service.virtual_place.VirtualInstrument", FaultyInstrument),
        virtual_place(Job(machine, plan, folder), ENCODER, TIME_SCALE, seed=0) as place,
    ):
        yield Bench(place, place.job)


async def until(pilot: Pilot[None], condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s, (
            f"it did not happen in time: {said(pilot.app)} {pilot.app.board.state} {pilot.app.board.messages}"
        )
        await asyncio.sleep(0.01)


async def press(app: StationApp, *keys: str) -> None:
    """Press keys; unlike the pilot's own, without waiting for the process to be idle, which instruments keep it from."""
    for key in keys:
        app.post_message(Key(key, key if len(key) == 1 else None))
        await asyncio.sleep(0.05)


async def accept(pilot: Pilot[None], app: StationApp) -> None:
    """Accept a run in which nothing is wrong: the machine waits for a busy computer."""
    before = app.board.accepted
    await press(app, "a")
    await until(pilot, lambda: app.board.accepted != before)


def said(app: StationApp) -> str:
    return " ".join(str(app.query_one("#now").visual).split())


def row(app: StationApp, part: str) -> str:
    return str(app.query_one(f"#{part}").visual)


async def circle(pilot: Pilot[None], app: StationApp, key: str = "enter") -> None:
    """Run the announced circle until it is complete."""
    await until(pilot, lambda: app.board.state is State.ANNOUNCED)
    await press(app, key)
    await until(pilot, lambda: app.board.state is State.COMPLETE)


def test_a_whole_plan_with_every_verdict(short_plan: PlanFile, tmp_path: Path) -> None:
    async def play(pilot: Pilot[None], app: StationApp) -> None:
        board = app.board
        await until(pilot, lambda: "short holder with the ball 9-short into bore 9" in said(app))
        assert "[9]" in row(app, "map")
        assert "tilt A 0° B 0°" in row(app, "set-up")
        await press(app, "a")  # means nothing yet
        await circle(pilot, app)
        await until(pilot, lambda: "measures it again" in said(app))
        await press(app, "r")
        await until(pilot, lambda: board.state is State.ANNOUNCED)
        await circle(pilot, app, "m")
        await accept(pilot, app)
        await until(pilot, lambda: board.accepted == 1 and "leave as is" in row(app, "set-up"))
        await circle(pilot, app)
        await until(pilot, lambda: row(app, "figures").count("low-") == 2)
        await press(app, "x")
        await until(pilot, lambda: board.finished is not None)
        await until(pilot, lambda: "without an accepted run: low cw" in said(app))
        assert "ccw ✓ accepted" in row(app, "runs")
        assert "1 of 2 accepted" in row(app, "progress")
        await press(app, "q")
        await until(pilot, lambda: isinstance(app.screen, TemperatureQuestion) and bool(app.screen.query(Input)))
        app.screen.query_one(Input).value = "20,9"
        await press(app, "enter")

    with switched_on(short_plan, tmp_path / "session") as bench:
        bench.press_all(play)
        runs = read_session(bench.job.folder).runs
    ccw, cw = ([run for run in runs if run.direction is direction] for direction in Direction)
    assert [(run.state, run.reason) for run in ccw] == [
        (RunState.REJECTED, "repeated by the operator"),
        (RunState.ACCEPTED, ""),
    ]
    assert [(run.state, run.reason) for run in cw] == [(RunState.REJECTED, "rejected by the operator")]
    assert (ccw[0].mounting, ccw[-1].mounting, cw[-1].mounting) == (1, 2, 2)


def test_quitting_a_running_circle_asks_first_and_loses_nothing(slow_plan: PlanFile, tmp_path: Path) -> None:
    async def play(pilot: Pilot[None], app: StationApp) -> None:
        board = app.board
        await until(pilot, lambda: board.state is State.ANNOUNCED)
        await press(app, "enter")
        await until(pilot, lambda: board.state is State.TURNING and len(board.traces[Direction.CCW]) > 100)
        await until(pilot, lambda: (app.query_one(TraceView)._members & 2 > 0).sum() > 5)
        assert "touch nothing" in said(app)
        assert "▶ running" in row(app, "runs")
        assert "° of 370°" in row(app, "progress")
        await press(app, "ctrl+c")
        await until(pilot, lambda: isinstance(app.screen, GiveUpQuestion))
        await press(app, "n")
        await until(pilot, lambda: not isinstance(app.screen, GiveUpQuestion))
        assert board.state is State.TURNING
        await press(app, "q")
        await until(pilot, lambda: isinstance(app.screen, GiveUpQuestion))
        await press(app, "y")
        await until(pilot, lambda: board.state is State.STOPPED)

    async def go_on(pilot: Pilot[None], app: StationApp) -> None:
        await until(pilot, lambda: app.board.state is State.ANNOUNCED)
        assert "low-ccw-2" in row(app, "title")

    with switched_on(slow_plan, tmp_path / "session") as bench:
        bench.press_all(play)
        assert bench.states() == [("low-ccw-1", RunState.RECORDING)]
        (part,) = (bench.job.folder / "runs").iterdir()
        assert part.name == "low-ccw-1.csv.part"
        assert len(part.read_text("utf-8").splitlines()) > 100
        bench.press_all(go_on)


def test_a_fault_of_the_line_is_shown_and_the_line_connected_again(short_plan: PlanFile, tmp_path: Path) -> None:
    async def play(pilot: Pilot[None], app: StationApp) -> None:
        board = app.board
        await until(pilot, lambda: board.state is State.ANNOUNCED)
        await press(app, "c")  # means nothing without a fault
        await press(app, "enter")
        await until(pilot, lambda: board.fault is not None)
        await until(pilot, lambda: "fell silent" in said(app))
        assert "FAULT at" in said(app)
        assert "What helps: " in said(app)
        assert "low-ccw-1 is kept as far as it came" in said(app)
        assert "fault: " in row(app, "messages")
        bench.place.wire.speak_again()
        # It is opened again by itself, and read beside the fault; going on is for people to say.
        await until(pilot, lambda: "no reading" not in row(app, "reading"))
        assert board.fault is not None
        await press(app, "c")
        await until(pilot, lambda: board.fault is None and board.state is State.ANNOUNCED)
        await until(pilot, lambda: "low-ccw-2" in row(app, "title"))
        await circle(pilot, app)
        await accept(pilot, app)
        await until(pilot, lambda: board.accepted == 1)

    with switched_on(short_plan, tmp_path / "session") as bench:
        faults = [bench.place.wire.go_silent]

        def helper(event: Event) -> None:
            bench.place.helper(event)
            if isinstance(event, FeedInSeen) and faults:
                faults.pop()()

        bench.press_all(play, (120, 40), helper)
        states = bench.states()
        assert states[0] == ("low-ccw-1", RunState.RECORDING)
        assert states[-1][1] is RunState.ACCEPTED


def test_a_closed_line_and_a_port_that_is_not_there(short_plan: PlanFile, tmp_path: Path) -> None:
    async def play(pilot: Pilot[None], app: StationApp) -> None:
        board = app.board
        await until(pilot, lambda: board.state is State.ANNOUNCED)
        bench.place.wire.hang_up()
        await until(pilot, lambda: "the line was closed while it was in use" in said(app))
        await press(app, "c")
        # What comes now is the text of a port that cannot be opened.
        await until(pilot, lambda: len(board.messages) > 1)
        assert isinstance(board.fault.error, InstrumentError)
        await until(pilot, lambda: "Then C connects again, Q leaves." in said(app))
        await press(app, "q")

    with switched_on(short_plan, tmp_path / "session") as bench:
        bench.press_all(play)


def test_closing_while_the_line_is_being_opened_ends_in_order(short_plan: PlanFile, tmp_path: Path) -> None:
    async def play(pilot: Pilot[None], app: StationApp) -> None:
        await press(app, "q")
        await until(pilot, lambda: app._exit)

    with switched_on(short_plan, tmp_path / "session") as bench:
        bench.press_all(play)


def test_a_verdict_that_was_not_given_is_asked_for_again(short_plan: PlanFile, tmp_path: Path) -> None:
    async def leave(pilot: Pilot[None], app: StationApp) -> None:
        await circle(pilot, app)
        await press(app, "q")
        await until(pilot, lambda: isinstance(app.screen, TemperatureQuestion))
        await press(app, "enter")
        await until(pilot, lambda: app.board.state is State.STOPPED)

    async def go_on(pilot: Pilot[None], app: StationApp) -> None:
        await until(pilot, lambda: app.board.state is State.COMPLETE)
        await until(pilot, lambda: "measures it again" in said(app))
        assert "waits for its verdict" in row(app, "messages")
        assert row(app, "figures").count("low-") == 1
        assert len(app.board.traces[Direction.CCW]) > 100
        await accept(pilot, app)
        await until(pilot, lambda: app.board.accepted == 1 and app.board.state is State.ANNOUNCED)

    with switched_on(short_plan, tmp_path / "session") as bench:
        bench.press_all(leave)
        assert bench.states()[-1][1] is RunState.COMPLETE
        bench.press_all(go_on)
        assert bench.states()[-1][1] is RunState.ACCEPTED


def test_repeat_and_reject_in_mid_circle_ask_first_one_question_at_a_time(slow_plan: PlanFile, tmp_path: Path) -> None:
    async def play(pilot: Pilot[None], app: StationApp) -> None:
        board = app.board
        await until(pilot, lambda: board.state is State.ANNOUNCED)
        await press(app, "enter")
        await until(pilot, lambda: board.state is State.TURNING)
        for key in ("r", "x", "ctrl+c"):
            await press(app, key)
            await until(pilot, lambda: isinstance(app.screen, GiveUpQuestion))
            await press(app, "ctrl+c" if key != "ctrl+c" else "n", "n")
            await until(pilot, lambda: len(app.screen_stack) == 1)
            assert board.state is State.TURNING
        app.action_leave()
        app.action_leave()  # as two Ctrl-C in one look
        await until(pilot, lambda: len(app.screen_stack) == 2)
        await press(app, "n")
        await until(pilot, lambda: len(app.screen_stack) == 1)
        await press(app, "x")
        await until(pilot, lambda: isinstance(app.screen, GiveUpQuestion))
        await press(app, "y")
        await until(pilot, lambda: board.state is State.ANNOUNCED and board.announced.run.direction is Direction.CW)

    with switched_on(slow_plan, tmp_path / "session") as bench:
        bench.press_all(play)
        assert bench.states() == [("low-ccw-1", RunState.REJECTED)]


def test_nothing_is_waited_for_in_a_pause(short_plan: PlanFile, tmp_path: Path) -> None:
    async def play(pilot: Pilot[None], app: StationApp) -> None:
        await until(pilot, lambda: app.board.state is State.ANNOUNCED)
        await press(app, "p")
        await until(pilot, lambda: app.board.state is State.PAUSED and "P goes on" in said(app))
        await press(app, "p")
        await until(pilot, lambda: app.board.state is State.ANNOUNCED)

    with switched_on(short_plan, tmp_path / "session") as bench:
        bench.press_all(play)


def test_the_overview_leads_to_another_test_and_takes_verdicts_back(short_plan: PlanFile, tmp_path: Path) -> None:
    async def play(pilot: Pilot[None], app: StationApp) -> None:
        board = app.board
        await circle(pilot, app)
        await accept(pilot, app)
        await until(pilot, lambda: board.accepted == 1 and board.state is State.ANNOUNCED)
        await press(app, "z", "f1")  # a wrong key is harmless
        await until(pilot, lambda: isinstance(app.screen, HelpScreen))
        await press(app, "escape")
        await until(pilot, lambda: len(app.screen_stack) == 1)
        await press(app, "f")
        await until(pilot, lambda: isinstance(app.screen, LargeScreen))
        await press(app, "f")
        await until(pilot, lambda: len(app.screen_stack) == 1)
        await press(app, "o")
        await until(pilot, lambda: isinstance(app.screen, OverviewScreen))
        await press(app, "left", "x")
        await until(pilot, lambda: isinstance(app.screen, ReasonQuestion))
        await press(app, "1")
        await until(pilot, lambda: board.accepted == 0)
        await until(pilot, lambda: isinstance(app.screen, OverviewScreen))
        await accept(pilot, app)
        await until(pilot, lambda: board.accepted == 1)
        await press(app, "right", "enter")
        await until(pilot, lambda: len(app.screen_stack) == 1 and board.announced.run.direction is Direction.CW)

    with switched_on(short_plan, tmp_path / "session") as bench:
        bench.press_all(play)
        assert bench.states()[-1][1] is RunState.ACCEPTED
