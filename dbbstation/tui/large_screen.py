"""Length, state and next action, readable from two metres."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, ClassVar

from textual.binding import Binding
from textual.content import Content

from dbbstation.quality.answer import Advice
from dbbstation.station.states import RECORDING, State
from dbbstation.tui.board_screen import RunScreen
from dbbstation.tui.footer import KeyFooter
from dbbstation.tui.now_line import NowLine, TitleLine
from dbbstation.tui.panel import Panel, lines
from dbbstation.tui.reading_panel import Age
from dbbstation.tui.texts import LARGE_WORDS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from textual.app import ComposeResult
    from textual.binding import BindingType

    from dbbstation.service.board import Board

HIGH = 5
"""Points of a letter from top to bottom."""

_FLATTEST = 3
"""Greatest ratio of a point's columns to its rows; a terminal's cell is about twice as high as wide."""

_FONT = {
    "0": "### #.# #.# #.# ###",
    "1": ".#. ##. .#. .#. ###",
    "2": "### ..# ### #.. ###",
    "3": "### ..# .## ..# ###",
    "4": "#.# #.# ### ..# ..#",
    "5": "### #.. ### ..# ###",
    "6": "### #.. ### #.# ###",
    "7": "### ..# ..# .#. .#.",
    "8": "### #.# ### #.# ###",
    "9": "### #.# ### ..# ###",
    ".": ". . . . #",
    "-": "... ... ### ... ...",
    "+": "... .#. ### .#. ...",
    "?": "### ..# .## ... .#.",
    " ": ".. .. .. .. ..",
    "A": "### #.# ### #.# #.#",
    "B": "##. #.# ##. #.# ##.",
    "C": "### #.. #.. #.. ###",
    "D": "##. #.# #.# #.# ##.",
    "E": "### #.. ##. #.. ###",
    "F": "### #.. ##. #.. #..",
    "G": "### #.. #.# #.# ###",
    "H": "#.# #.# ### #.# #.#",
    "I": "# # # # #",
    "J": "..# ..# ..# #.# ###",
    "K": "#.# #.# ##. #.# #.#",
    "L": "#.. #.. #.. #.. ###",
    "M": "#...# ##.## #.#.# #...# #...#",
    "N": "#..# ##.# #.## #..# #..#",
    "O": "### #.# #.# #.# ###",
    "P": "### #.# ### #.. #..",
    "Q": "### #.# #.# ### ..#",
    "R": "##. #.# ##. #.# #.#",
    "S": "### #.. ### ..# ###",
    "T": "### .#. .#. .#. .#.",
    "U": "#.# #.# #.# #.# ###",
    "V": "#.# #.# #.# #.# .#.",
    "W": "#...# #...# #.#.# ##.## #...#",
    "X": "#.# #.# .#. #.# #.#",
    "Y": "#.# #.# .#. .#. .#.",
    "Z": "### ..# .#. #.. ###",
}


def largest(texts: Sequence[str], width: int, height: int) -> tuple[int, int]:
    """Return the largest size of a point [columns, rows] with which all texts fit."""
    points = max(len(_points(text)[0]) for text in texts)
    wide, high = max(width // points, 1), max(height // HIGH, 1)
    return min(wide, _FLATTEST * high), min(high, wide)


def block_rows(text: str, wide: int, high: int) -> list[str]:
    """Return a text in large letters, one string per row of the screen. Unknown characters become question marks."""
    rows = []
    for points in _points(text):
        row = "".join(("█" if point == "#" else " ") * wide for point in points)
        rows += [row] * high
    return rows


def _points(text: str) -> list[str]:
    letters = [_FONT.get(letter, _FONT["?"]).split() for letter in text.upper()]
    return [".".join(letter[row] for letter in letters) for row in range(HIGH)]


NO_LENGTH = "---.----"
_WIDEST = "hands off"

LARGE_STYLES = {
    Advice.GOOD: "$text-success",
    Advice.CANNOT_TELL: "$text-warning",
    Advice.REPEAT: "bold $text-error",
}
"""Colours of a run's verdict, which the letters show as well."""

_TEXTS = 3


class LargeFigures(Panel):
    """Three rows of letters as large as fit."""

    def __init__(self, *, clock: Callable[[], float] = time.monotonic, id: str | None = None) -> None:  # noqa: A002 - Textual's name
        super().__init__(id=id)
        self._age = Age(clock)

    def text(self, board: Board) -> Content:
        state, action = LARGE_WORDS[board.state]
        state_style = "$text-primary"
        if board.state is State.COMPLETE and board.completed is not None:
            word = board.completed.answer.word
            state, state_style = str(word), LARGE_STYLES[word]
            if board.doubted:
                state, state_style, action = "go back", LARGE_STYLES[Advice.REPEAT], "Enter"
            elif word is Advice.CANNOT_TELL:
                action = "U"
        length = self._length(board)
        # One size for all states: letters that change their size are harder to read than small ones.
        room = self.content_size
        for_one = (room.height - _TEXTS + 1) // _TEXTS
        _, high = usual = largest((length, NO_LENGTH, _WIDEST), room.width, for_one)
        # The longest word on a run is the exception.
        sizes = (usual, min(usual, largest((state,), room.width, for_one)), usual)
        gap = min(max((room.height - _TEXTS * HIGH * high) // (_TEXTS - 1), 0), HIGH * high)
        rows: list[Content] = []
        styles = ("bold", state_style, "$text-warning" if board.state in RECORDING else "$text-success")
        for text, style, size in zip((length, state, action), styles, sizes, strict=True):
            rows += [Content.styled(row, style) for row in block_rows(text, *size)]
            rows += [Content("")] * gap
        return lines(*rows)

    def _length(self, board: Board) -> str:
        stale = self._age.stale_s(board) is not None
        sample = board.sample
        if sample is None or stale or sample.length_mm is None or sample.status != "ok":
            return NO_LENGTH
        return f"{sample.length_mm:.4f}"


class LargeScreen(RunScreen):
    """The measuring screen with large letters instead of the trace."""

    help_name = "large"

    BINDINGS: ClassVar[list[BindingType]] = [
        # The key that came here goes back as well, and stands in the footer, which has room for one of both at 80 columns.
        Binding("escape", "app.large", "Back", show=False)
    ]

    def compose(self) -> ComposeResult:
        yield TitleLine(self._show.plan, id="large-title")
        yield NowLine(id="large-now")
        yield LargeFigures(clock=self._clock, id="large-figures")
        yield KeyFooter()
