"""Blocks: the sorted words of one line, checked for conflicts."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dbbstation.nc.rs274 import codes
from dbbstation.nc.rs274.codes import ModalGroup
from dbbstation.nc.rs274.tokens import BadLine, Comment, ParameterSetting, Place, Word, tokens, unknown_value

if TYPE_CHECKING:
    from collections.abc import Callable


BLANKS = " \t\r"

LONGEST_BYTES = 252
"""LinuxCNC's interpreter refuses longer lines; a CR before the line feed counts as a byte [measured with rs274 2.9]."""

_CONTROL = re.compile("[\x00-\x08\x0a-\x1f\x7f-\x9f\u2028\u2029]")
"""All control characters except the tab, and Unicode's line separators."""


@dataclass(slots=True)
class ProgramBlock:
    """One line.

    Attributes:
        codes: G and M codes by group.
        message: a comment that LinuxCNC acts on; empty if none.
    """

    place: Place
    words: dict[str, Word] = field(default_factory=dict)
    codes: dict[ModalGroup, Word] = field(default_factory=dict)
    settings: list[ParameterSetting] = field(default_factory=list)
    comments: list[str] = field(default_factory=list)
    message: str = ""

    def code(self, group: ModalGroup) -> float | None:
        """Return the code of a group, or None."""
        word = self.codes.get(group)
        return None if word is None else word.value

    @property
    def first_column(self) -> int:
        """Return the column of the first word that is neither code nor line number; if there is none, of the first code."""
        words = [word.column for word in self.words.values()]
        return min(words) if words else next((word.column for word in self.codes.values()), 1)

    def fault(self, what: str, remedy: str, at: Word | Comment | int | None = None) -> BadLine:
        """Return the exception for a fault at a word, a column or the first word."""
        column = self.first_column if at is None else at if isinstance(at, int) else at.column
        return self.place.fault(column, what, remedy)


def block_of(line: str, place: Place, value_of: Callable[[int | str], float | None] = unknown_value) -> ProgramBlock:
    """Return the block of a line.

    Raises:
        BadLine: the first thing in it that cannot be read.
    """
    block = ProgramBlock(place)
    for token in tokens(_checked(line, place), place, value_of):
        if isinstance(token, Comment):
            _take_comment(block, token)
        elif isinstance(token, ParameterSetting):
            block.settings.append(token)
        elif token.letter in "GM":
            _take_code(block, token)
        elif token.letter not in codes.LETTERS:
            what = f"words with the letter {token.letter} are not read ({token.letter}{token.value:g})"
            raise place.fault(token.column, what, codes.remedy_of_letter(token.letter))
        elif token.letter == "N" and (block.words or block.codes or block.comments):
            raise place.fault(
                token.column, "the line number N is not at the line's begin", "write it at the line's begin"
            )
        elif token.letter in block.words:
            what = f"a second {token.letter} in one line"
            raise place.fault(token.column, what, "write one move per line")
        else:
            block.words[token.letter] = token
    return block


def _checked(line: str, place: Place) -> str:
    line_bytes = len(line) if line.isascii() else len(line.encode("utf-8", "surrogatepass"))
    if line_bytes > LONGEST_BYTES:
        what = f"the line has {line_bytes} characters"
        raise place.fault(LONGEST_BYTES + 1, what, f"LinuxCNC reads {LONGEST_BYTES}: write it as two lines")
    line = line.rstrip("\r")
    control = None if line.isprintable() else _CONTROL.search(line)
    if control is not None:
        what = f"the control character U+{ord(control[0]):04X}, which ends a line for some programs and not for others"
        raise place.fault(control.start() + 1, what, "remove it, or end the line with a line feed")
    return line


_ACTIVE = re.compile(
    r"(?:msg|debug|print|log|logopen|logappend|probeopen|abort),|(?:logclose|probeclose)", re.IGNORECASE
)
"""First words of the comments that LinuxCNC executes."""

_PYTHON = re.compile(r"py,|pyrun,|pyreload", re.IGNORECASE)


def _take_comment(block: ProgramBlock, comment: Comment) -> None:
    text = comment.text.lstrip(BLANKS)
    if _PYTHON.match(text):
        what = "a comment that runs Python in the control, which may move it"
        raise block.fault(what, "post the program without it", comment)
    if comment.bracketed and block.message:
        block.comments.append(block.message.rstrip(BLANKS))
        block.message = ""
    if comment.bracketed and _ACTIVE.match(text):
        block.message = text
    else:
        block.comments.append(text.rstrip(BLANKS))


def _take_code(block: ProgramBlock, word: Word) -> None:
    if math.isnan(word.value):
        return  # its parameters are known once it runs
    known = codes.G_CODES if word.letter == "G" else codes.M_CODES
    value = round(word.value, 1)
    group = known.get(value) if abs(value - word.value) < WITHIN else None
    if group is ModalGroup.NOTHING:
        return
    name = codes.name(word.letter, word.value)
    if group is None:
        raise block.fault(f"{name} is not read", codes.remedy(word.letter, word.value), word)
    other = block.codes.get(group) or block.codes.get(codes.EXCLUDED.get(group, group))
    if other is not None:
        what = f"{name} and {codes.name(other.letter, other.value)} exclude each other in one line ({group})"
        raise block.fault(what, "write them in separate lines, or remove one", word)
    block.codes[group] = word._replace(value=value)


WITHIN = 1e-4
"""Largest difference of a computed code from its number."""
