"""Large letters of blocks, three to five by five points."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

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
