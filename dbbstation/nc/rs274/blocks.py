"""Blocks: the sorted words of one line, checked for conflicts."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dbbstation.errors import Problem
from dbbstation.nc.rs274 import codes
from dbbstation.nc.rs274.codes import ModalGroup
from dbbstation.nc.rs274.guard import guard_at
from dbbstation.nc.rs274.tokens import BadLine, Comment, Place, Word, tokens

if TYPE_CHECKING:
    from collections.abc import Iterator

BLANKS = " \t\r"

LONGEST_BYTES = 252
"""LinuxCNC's interpreter refuses lines of more bytes, the CR before the line feed counted [measured with rs274 2.9]."""

MOST_GUARD = 1000
"""A guard has fewer lines, empty ones between them counted."""

_MAY_GUARD = re.compile(r"[ \t]*+(?:[nN][0-9 \t]++)?+[oO]")

_CONTROL = re.compile("[\x00-\x08\x0a-\x1f\x7f-\x9f\u2028\u2029]")
"""All control characters but the tab, and the line separators of Unicode."""

MOST_FAULTS = 20
"""A program of another language has a fault in every line; the first ones tell."""


@dataclass(slots=True)
class ProgramBlock:
    """One line.

    Attributes:
        words: other than codes, by letter.
        codes: G and M codes by group.
        comments: those without effect.
        message: a comment that LinuxCNC acts on; empty if none.
        guard: work systems of a guard that begins here; None if none begins.
    """

    place: Place
    words: dict[str, Word] = field(default_factory=dict)
    codes: dict[ModalGroup, Word] = field(default_factory=dict)
    comments: list[str] = field(default_factory=list)
    message: str = ""
    guard: tuple[str, ...] | None = None

    def code(self, group: ModalGroup) -> float | None:
        """Return the code of a group, or None."""
        word = self.codes.get(group)
        return None if word is None else word.value


def blocks(text: str, file: str, faults: list[Problem]) -> Iterator[ProgramBlock]:
    """Yield lines up to the program's end, one by one to save memory.

    Args:
        faults: complete once every block was taken; a missing end is one.
    """
    lines = text.split("\n")
    percent, first = _opening(lines)
    behind_guard = first
    for number, line in enumerate(lines[first:], first + 1):
        if number <= behind_guard:
            continue
        if percent and _is_percent(line):
            return
        place = Place(file, number)
        guard = guard_at(lines[number - 1 : number - 1 + MOST_GUARD]) if _MAY_GUARD.match(line) else None
        if guard is not None:
            yield ProgramBlock(place, guard=guard[0])
            behind_guard = number - 1 + guard[1]
            continue
        try:
            block = _block(_one_line(line, place), place)
        except BadLine as fault:
            faults.append(fault.problem)
            if len(faults) >= MOST_FAULTS:
                return
            continue
        yield block
        if block.code(ModalGroup.STOP) in {2.0, 30.0}:
            if percent and not any(_is_percent(after) for after in lines[number:]):
                faults.append(_cut_short(file, lines, "the % that closes it"))
            return
    faults.append(_cut_short(file, lines, "the % that closes it" if percent else "M2 or M30"))


def _opening(lines: list[str]) -> tuple[bool, int]:
    """Return whether the first line that is not empty is a percent sign, and the index of the first line to read.

    Between percent signs a program needs no other end. Elsewhere a percent sign is a fault, as for LinuxCNC.
    """
    start = next((index for index, line in enumerate(lines) if line.strip(BLANKS)), 0)
    return (True, start + 1) if _is_percent(lines[start]) else (False, 0)


def _is_percent(line: str) -> bool:
    return line.strip(BLANKS) == "%"


def _cut_short(file: str, lines: list[str], end: str) -> Problem:
    what = f"the program ends without {end}: it may have been cut short"
    return Problem(file, len(lines), 0, what, "copy it again, or add its end where it is whole")


def _one_line(line: str, place: Place) -> str:
    """Return the line without a CR at its end.

    Raises:
        BadLine: it is longer than LinuxCNC reads, or has a character in it that some programs take for the end of a line.
    """
    line_bytes = len(line) if line.isascii() else len(line.encode("utf-8", "surrogatepass"))
    if line_bytes > LONGEST_BYTES:
        what = f"the line has {line_bytes} characters"
        raise place.fault(LONGEST_BYTES + 1, what, f"LinuxCNC reads {LONGEST_BYTES}: write it as two lines")
    line = line.removesuffix("\r")
    control = None if line.isprintable() else _CONTROL.search(line)
    if control is not None:
        what = f"the control character U+{ord(control[0]):04X}, which ends a line for some programs and not for others"
        raise place.fault(control.start() + 1, what, "remove it, or end the line with a line feed")
    return line


def _block(line: str, place: Place) -> ProgramBlock:
    block = ProgramBlock(place)
    for token in tokens(line, place):
        if isinstance(token, Comment):
            _take_comment(block, token)
        elif token.letter in "GM":
            _take_code(block, token)
        elif token.letter not in codes.LETTERS:
            what = f"words with the letter {token.letter} are not read ({token.letter}{token.value:g})"
            raise place.fault(token.column, what, codes.remedy_of_letter(token.letter))
        elif token.letter == "N" and (block.words or block.codes or block.comments):
            raise place.fault(token.column, "the line number N does not stand first", "write it at the line's begin")
        elif token.letter in block.words:
            what = f"a second {token.letter} in one line"
            raise place.fault(token.column, what, "write one move per line")
        else:
            block.words[token.letter] = token
    return block


_ACTIVE = re.compile(
    r"(?:msg|debug|print|log|logopen|logappend|probeopen|abort),|(?:logclose|probeclose)", re.IGNORECASE
)
"""Begins of comments that LinuxCNC acts on."""

_PYTHON = re.compile(r"py,|pyrun,|pyreload", re.IGNORECASE)


def _take_comment(block: ProgramBlock, comment: Comment) -> None:
    """Add a comment. LinuxCNC obeys only the last of several in brackets [measured with rs274 2.9]."""
    text = comment.text.lstrip(BLANKS)
    if _PYTHON.match(text):
        what = "a comment that runs Python in the control, which may move it"
        raise block.place.fault(comment.column, what, "post the program without it")
    if comment.bracketed and block.message:
        block.comments.append(block.message.rstrip(BLANKS))
        block.message = ""
    if comment.bracketed and _ACTIVE.match(text):
        block.message = text
    else:
        block.comments.append(text.rstrip(BLANKS))


def _take_code(block: ProgramBlock, word: Word) -> None:
    known = codes.G_CODES if word.letter == "G" else codes.M_CODES
    group = known.get(word.value)
    name = codes.name(word.letter, word.value)
    if group is None:
        raise block.place.fault(word.column, f"{name} is not read", codes.remedy(word.letter, word.value))
    if group in block.codes:
        other = block.codes[group]
        what = f"{name} and {codes.name(other.letter, other.value)} exclude each other in one line ({group})"
        raise block.place.fault(word.column, what, "write them in separate lines, or remove one")
    block.codes[group] = word
