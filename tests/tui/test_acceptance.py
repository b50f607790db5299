"""Acceptance by keys: choose the session before, see the verdict, end it, wrong keys."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from textual.pilot import Pilot
from textual.widgets import OptionList, Static

from dbbstation.errors import InputError, Problem
from dbbstation.service.after import After
from dbbstation.service.former_sessions import BeforeAndNow
from dbbstation.service.work import SessionTask, WorkProgress
from dbbstation.tui.acceptance_screen import AcceptanceScreen
from dbbstation.tui.app import StationApp
from dbbstation.tui.help_screen import HelpScreen
from dbbstation.tui.questions import ChooseQuestion
from dbbstation.tui.results_screen import ResultsScreen
from tests.service.test_front import Scripted
from tests.tui.test_session_stills import acceptance, formers, front

ANSWER = acceptance(None)._after.results[SessionTask.ACCEPTANCE].answer  # type: ignore[arg-type]
FOUND = formers(None)._search(Path())  # type: ignore[arg-type]


class Compared(Scripted):
    """A report of two sessions that ends as it is told to."""

    def answer(self) -> dict[str, object]:
        return ANSWER


def texts_of(app: StationApp, name: str) -> str:
    return " ".join(str(app.screen.query_one(name, Static).visual).split())


def rows(app: StationApp) -> list[str]:
    options = app.screen.query_one("#rows", OptionList)
    return [str(options.get_option_at_index(place).prompt) for place in range(options.option_count)]


def play(
    after: After,
    keys: Callable[[Pilot[None], StationApp], Awaitable[None]],
    search: Callable[[Path], BeforeAndNow] = lambda _folder: FOUND,
) -> None:
    app = StationApp(None, None, front=front())

    async def run() -> None:
        async with app.run_test(size=(80, 24)) as pilot:
            await pilot.pause()
            await app.push_screen(ResultsScreen(after))
            screen = AcceptanceScreen(after, search)
            await app.push_screen(screen)
            while screen._found is None and not screen._failure:
                await pilot.pause(0.02)
            await pilot.pause()
            await keys(pilot, app)

    asyncio.run(run())


@pytest.fixture
def after(tmp_path: Path) -> After:
    return After(tmp_path / "verified", start=Compared)  # type: ignore[arg-type]


def test_the_session_before_is_chosen_and_the_verdict_shown(after: After) -> None:
    async def keys(pilot: Pilot[None], app: StationApp) -> None:
        assert "Choose the session measured before" in texts_of(app, "#row-now")
        assert ["tuesday" in rows(app)[0], "monday" in rows(app)[1]] == [True, True]
        await pilot.press("x", "c", "d", "p", "r", "a", "1", "0")  # mean nothing here
        assert after.busy is None
        await pilot.press("down", "enter")
        assert after.busy is SessionTask.ACCEPTANCE
        assert "Comparing: fit of 6 runs" in texts_of(app, "#row-now")
        _, work = after._running
        assert work.call.given["before"] == str(Path("/shop/monday"))
        await pilot.press("h")  # not while it is being compared
        assert isinstance(app.screen, AcceptanceScreen)
        work.progress = WorkProgress.DONE
        app.look()
        await pilot.pause()
        assert texts_of(app, "#row-now").startswith("CANNOT TELL")
        assert [row.replace("▸", "").split()[0] for row in rows(app)] == ["test", "level", "side", "high"]
        assert rows(app)[1].split()[-5:] == ["21.4", "4.8", "8", "1.2", "PASS"]
        assert rows(app)[3].split()[-6:] == ["-", "7.6", "8", "1.2", "CANNOT", "TELL"]
        below = texts_of(app, "#row-text")
        assert "before, nothing was compensated; machine and plan lie in /shop/monday" in below
        assert str(after.folder / "acceptance.html") in below
        await pilot.press("f1")
        assert isinstance(app.screen, HelpScreen)
        await pilot.press("escape")
        await pilot.pause()
        await pilot.press("h")
        await pilot.pause()
        assert isinstance(app.screen, ChooseQuestion)
        await pilot.press("escape")
        await pilot.pause()
        await pilot.press("escape")
        await pilot.pause()
        assert isinstance(app.screen, ResultsScreen)
        await pilot.press("down", "down", "down", "down")
        assert "CANNOT TELL" in texts_of(app, "#row-text")

    play(after, keys)


def test_a_comparison_can_be_ended_and_made_again(after: After) -> None:
    async def keys(pilot: Pilot[None], app: StationApp) -> None:
        await pilot.press("enter")
        await pilot.pause()
        assert after.busy is SessionTask.ACCEPTANCE
        await pilot.press("k")
        await pilot.pause()
        app.look()
        await pilot.pause()
        assert "Ended before it was done" in texts_of(app, "#row-now")
        await pilot.press("h")
        await pilot.pause()
        assert isinstance(app.screen, ChooseQuestion)
        await pilot.press("enter")
        await pilot.pause()
        assert after.busy is SessionTask.ACCEPTANCE

    play(after, keys)


def test_nothing_to_compare_and_a_session_that_cannot_be_read_are_said(after: After) -> None:
    async def nothing(pilot: Pilot[None], app: StationApp) -> None:
        assert "there is nothing to compare" in texts_of(app, "#row-now")
        await pilot.press("h", "enter", "k")
        assert (after.busy, after.former) == (None, None)

    async def broken(_pilot: Pilot[None], app: StationApp) -> None:
        assert "the machine's file is gone" in texts_of(app, "#row-now")

    def fails(_folder: Path) -> BeforeAndNow:
        raise InputError([Problem("session.yaml", 0, 0, "the machine's file is gone")])

    play(after, nothing, lambda _folder: BeforeAndNow(FOUND.now, ()))
    play(after, broken, fails)


def test_the_results_open_it(after: After) -> None:
    app = StationApp(None, None, front=front())

    async def run() -> None:
        async with app.run_test(size=(80, 24)) as pilot:
            await app.push_screen(ResultsScreen(after))
            await pilot.press("5")
            assert isinstance(app.screen, AcceptanceScreen)
            await pilot.press("escape")
            assert isinstance(app.screen, ResultsScreen)
            # The row that was chosen opens it too.
            await pilot.press("enter")
            assert isinstance(app.screen, AcceptanceScreen)

    asyncio.run(run())
