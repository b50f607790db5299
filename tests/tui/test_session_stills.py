"""Pictures of the screens before and after a sequence, compared with those that were looked at and kept.

    DBBSTATION_KEEP_STILLS=1 pytest tests/tui/test_session_stills.py

keeps new ones; look at them before committing.
"""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING

import pytest

from dbbstation.facts.held import HeldTolerance, WorstCircle
from dbbstation.facts.serialise import plain
from dbbstation.files.places import shipped_folder
from dbbstation.instrument.reading import Reading
from dbbstation.service.after import After, Result
from dbbstation.service.bar_calibration import Calibrated
from dbbstation.service.choice import Choice, Gate, Order, Prepared
from dbbstation.service.former_sessions import BeforeAndNow, Former, InForce
from dbbstation.service.front import Front
from dbbstation.service.memory import Line, Memory, Remembered
from dbbstation.service.session_list import SessionLine
from dbbstation.service.work import SessionTask, WorkProgress
from dbbstation.station.events import Sample
from dbbstation.tui import texts
from dbbstation.tui.acceptance_screen import AcceptanceScreen
from dbbstation.tui.app import StationApp
from dbbstation.tui.bar_screen import BarScreen
from dbbstation.tui.new_screen import NewScreen
from dbbstation.tui.prepare_screen import PrepareScreen
from dbbstation.tui.results_screen import ResultsScreen
from dbbstation.tui.row_screen import RowScreen
from tests.tui.test_stills import KEEP, KEPT, drawn

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.instrument.protocol import Protocol
    from dbbstation.service.held_line import HeldLine

SIZES = [(80, 24), (120, 40), (200, 60)]
SHOP = Path("/shop")
MEASURED = datetime(2026, 11, 20, 15, 30, tzinfo=UTC)
DISPLAY = Line(instrument="heidenhain-nd281b", port="/dev/ttyUSB0")

SESSIONS = (
    SessionLine(SHOP / "2026-11-20-hexapod-7", MEASURED, "Table II", "Hexapod 7", 11, 30, 1, 2530.0),
    SessionLine(SHOP / "monday", MEASURED, "Ten-minute check", "Hexapod 7", 6, 6),
    SessionLine(SHOP / "broken", MEASURED, problem="the machine's file cannot be read"),
)


class Memorised(Memory):
    """What was chosen last, without a file."""

    def read(self) -> Remembered:
        return Remembered(line=DISPLAY)


@dataclass(frozen=True, eq=False)
class StillFront(Front):
    """A front desk at which everything has been found already."""

    def sessions(self) -> tuple[SessionLine, ...]:
        return SESSIONS

    def hold(self, protocol: Protocol, line: Line) -> HeldLine | None:  # noqa: ARG002 - as the front has it
        return None if line.virtual else StillLine()  # type: ignore[return-value]


class StillLine:
    """A display that reads the bar at the feed-in point."""

    latest = Sample(1.0, 151.4987)
    failure = None
    rate = SimpleNamespace(per_s=8.1)


class StillCalibration:
    """A bar that has been read on its calibrator."""

    latest = Reading(1.0, 150.0021)
    failure = None
    busy = False
    done = count = 200
    found = Calibrated(SHOP / "bar-2026-11-20.yaml", 1.84, 0.27, 0.05, drifted=False)

    def close(self) -> None:
        """Do nothing."""


def front() -> StillFront:
    return StillFront(SHOP, Memorised())


def start(_app: StationApp) -> None:
    return None


def new(app: StationApp) -> RowScreen:
    choice = Choice(SHOP / "session", plan=SHOP / "table2.yaml", line=DISPLAY, operator="A. Machinist")
    return NewScreen(app, front(), choice)


def prepare(app: StationApp) -> RowScreen:
    desk = front()
    choice = replace(desk.virtual_choice(), folder=SHOP / "session", ambient_temp_c=20.5, operator="A. Machinist")
    screen = PrepareScreen(app, desk, choice, desk.prepare(choice))
    screen._confirmed = {"bar", "jig"}
    return screen


def prepare_again(app: StationApp) -> RowScreen:
    desk = front()
    choice = Choice(shipped_folder("fixtures") / "sessions" / "begun", line=DISPLAY)
    return PrepareScreen(app, desk, choice, desk.prepare(choice))


@cache
def in_turn() -> tuple[Choice, Prepared]:
    desk = front()
    table2 = shipped_folder("protocols") / "plans" / "table2.yaml"
    choice = replace(
        desk.virtual_choice(),
        folder=SHOP / "session",
        plan=table2,
        line=DISPLAY,
        bar_waiver="a first look",
        order=Order.DRIFT,
        gate=Gate.HOLDERS,
        job="order 4711",
    )
    return choice, desk.prepare(choice)


def prepare_in_turn(app: StationApp) -> RowScreen:
    return PrepareScreen(app, front(), *in_turn())


def bar(_app: StationApp) -> RowScreen:
    screen = BarScreen(front(), DISPLAY, lambda _path: None)
    values = dict(zip(texts.BAR_ROWS, ("DBB-0042", "ZB-17", "150.0003", "0.25", "2026-03-01", "", "20.3"), strict=True))
    screen._values = values
    screen._reopen = lambda: setattr(screen, "_calibration", StillCalibration())
    return screen


def results(_app: StationApp) -> RowScreen:
    after = After(SHOP / "monday")
    answer = {
        "verdict": {
            "kind": "exceeded",
            "headline": "The machine is NOT within the shop's tolerances.",
            "reasons": [
                "Circular deviation: run high ccw 1 has 21.4 µm, U 1.2 µm; at most 15 µm. 2 of 6 circles exceed it."
            ],
            "to_do": ["Calibrate the machine: `dbbstation calibrate monday --out model.yaml`."],
        }
    }
    after.results[SessionTask.REPORT] = Result(
        WorkProgress.DONE, "", 4.2, answer, "", SHOP / "monday-results" / "report.html"
    )
    after.results[SessionTask.CALIBRATE] = Result(WorkProgress.CANCELLED, "fit of 6 runs", 1.3)
    return ResultsScreen(after)


def held(um: float, u_um: float, largest_um: float, conformity: str, test: str) -> dict[str, object]:
    worst = WorstCircle(test, "ccw", 1, um, 2.0 * u_um, None)
    return plain(
        HeldTolerance(
            quantity="circular-deviation",
            filter=None,
            largest_um=largest_um,
            tests=(),
            directions=(),
            conformity=conformity,
            within=conformity == "within",
            exceeded=int(conformity == "exceeded"),
            undecided=int(conformity == "cannot tell"),
            circles=1,
            worst=worst,
        )
    )


def acceptance(_app: StationApp) -> RowScreen:
    """Three tests; the limit of the last lies within U of its figure."""
    after = After(SHOP / "verified")
    before = [held(21.4, 0.6, 8.0, "exceeded", "level"), held(17.0, 0.6, 8.0, "exceeded", "side")]
    tests = [
        {"test": "level", **held(4.8, 0.6, 8.0, "within", "level"), "before": before[0]},
        {"test": "side", **held(5.1, 0.6, 8.0, "within", "side"), "before": before[1]},
        {"test": "high", **held(7.6, 0.6, 8.0, "cannot tell", "high"), "before": None},
    ]
    worst = {**held(7.6, 0.6, 8.0, "cannot tell", "high"), "before": before[0]}
    verdict = {"kind": "cannot tell", "headline": "It cannot be told.", "reasons": [], "to_do": []}
    answer = {"verdict": verdict, "tolerances": [worst], "tolerances_by_test": tests}
    page = SHOP / "verified-results" / "acceptance.html"
    after.results[SessionTask.ACCEPTANCE] = Result(WorkProgress.DONE, "", 4.2, answer, "", page)
    programs = SHOP / "monday" / "programs"
    after.former = Former(SHOP / "monday", MEASURED, InForce(6, 6, programs, (SHOP / "joint-model.yaml",)))
    after.kept = (SHOP / "verified-results" / "former-model-1f0c9a22.yaml",)
    found = BeforeAndNow(InForce(6, 6, SHOP / "verified" / "programs"), (after.former,))
    return AcceptanceScreen(after, lambda _folder: found)


def formers(_app: StationApp) -> RowScreen:
    offered = (
        Former(SHOP / "tuesday", MEASURED, InForce(6, 4, SHOP / "tuesday" / "programs")),
        Former(SHOP / "monday", MEASURED, InForce(6, 0, None)),
    )
    found = BeforeAndNow(InForce(6, 6, SHOP / "verified" / "programs"), offered)
    return AcceptanceScreen(After(SHOP / "verified"), lambda _folder: found)


async def still(make: Callable[[StationApp], RowScreen | None], size: tuple[int, int]) -> str:
    app = StationApp(None, None, front=front())
    async with app.run_test(size=size) as pilot:
        await pilot.pause()
        while app._works:
            await pilot.pause(0.02)
            app.look()
        screen = make(app)
        if screen is not None:
            await app.push_screen(screen)
        if isinstance(screen, ResultsScreen):
            await pilot.press("down", "down", "down")
        if isinstance(screen, AcceptanceScreen) and screen._searching is not None:
            screen._searching.result()
        for _ in range(4):
            await pilot.pause()
            app.look()
        return app.export_screenshot(title="dbbstation measure")


@pytest.fixture(autouse=True)
def one_time_zone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "UTC")
    if hasattr(time, "tzset"):
        time.tzset()


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
@pytest.mark.parametrize(
    "make",
    [start, new, prepare, prepare_again, prepare_in_turn, bar, results, acceptance, formers],
    ids=lambda make: make.__name__,
)
def test_screens_before_and_after_look_as_they_did(
    make: Callable[[StationApp], RowScreen | None], size: tuple[int, int]
) -> None:
    text, _ = drawn(asyncio.run(still(make, size)))
    text = text.replace(str(shipped_folder("fixtures").parent), "…")
    kept = KEPT / f"{make.__name__}-{size[0]}x{size[1]}.txt"
    if KEEP:
        kept.write_text(text, encoding="utf-8")
    assert text.splitlines() == kept.read_text(encoding="utf-8").splitlines()
