"""Large letters from blocks: a font of three to five by five, each of its points two columns wide."""

from __future__ import annotations

HIGH = 5
"""Points of a letter from top to bottom."""

_WIDE = 2
"""Columns of a point: a terminal's cell is about twice as high as wide."""

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


def columns(text: str) -> int:
    """Return how many columns a text takes at scale 1."""
    return len(_points(text)[0]) * _WIDE


def block_rows(text: str, scale: int) -> list[str]:
    """Return the rows of a text in large letters; what the font does not have is a question mark.

    Args:
        text: letters, digits and `.-+?`; small letters become large ones.
        scale: how many times larger, at least 1.
    """
    rows = []
    for points in _points(text):
        row = "".join(("█" if point == "#" else " ") * (_WIDE * scale) for point in points)
        rows += [row] * scale
    return rows


def _points(text: str) -> list[str]:
    letters = [_FONT.get(letter, _FONT["?"]).split() for letter in text.upper()]
    return [".".join(letter[row] for letter in letters) for row in range(HIGH)]
