"""Single lines of the screen, from a board alone: nothing is drawn."""

from __future__ import annotations

import pytest

from dbbstation.station.states import FINAL, State
from dbbstation.tui.app import _NOT_OPERATED
from dbbstation.tui.help_screen import HELP
from dbbstation.tui.now_line import TitleLine
from dbbstation.tui.overview_panels import LeftLine
from dbbstation.tui.texts import VIRTUAL_BANNER
from tests.tui.happenings import Happening


@pytest.mark.parametrize("state", [state for state in State if state not in FINAL])
def test_the_title_keeps_run_and_state_at_eighty_columns(state: State) -> None:
    board = Happening().board()
    board.virtual, board.state = True, state
    for plan in (
        "Ten-minute check",
        "A plan with a name that is longer than any line of the smallest terminal is wide",
    ):
        title = TitleLine(plan).text(board).plain
        assert len(title) <= 80
        assert title.endswith(f"t0-ccw-1 · {state}")
        assert title.startswith(VIRTUAL_BANNER)


def test_the_overview_says_that_verdicts_can_be_taken_back_when_the_plan_is_through() -> None:
    happening = Happening()
    board = happening.board()
    board.state, board.allowed = State.FINISHED, frozenset()
    told = LeftLine(happening.shown()).text(board).plain
    assert "X takes a verdict back" in told
    assert "have to wait" not in told


def test_what_an_operator_cannot_press_is_a_key_of_every_screen() -> None:
    assert set(_NOT_OPERATED.values()) <= set(HELP["everywhere"].keys)
