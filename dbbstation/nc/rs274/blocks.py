"""Blocks: the words of one line sorted by what they are, checked for what must not stand together."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dbbstation.nc.rs274 import codes
from dbbstation.nc.rs274.codes import Group
from dbbstation.nc.rs274.tokens import BadLine, Place, Word, tokens

if TYPE_CHECKING:
    from dbbstation.errors import Problem

MOST_FAULTS = 20
"""A program of another language has a fault in every line; the first ones tell."""


@dataclass(slots=True)
class Block:
    """One line.

    Attributes:
        place: file and line.
        words: those that are no code, by letter.
        codes: G and M codes by their group.
        comments: texts of its comments.
    """

    place: Place
    words: dict[str, Word] = field(default_factory=dict)
    codes: dict[Group, Word] = field(default_factory=dict)
    comments: list[str] = field(default_factory=list)

    def code(self, group: Group) -> float | None:
        """Number of the code of a group, None where the line has none."""
        word = self.codes.get(group)
        return None if word is None else word.value


def blocks(text: str, file: str, faults: list[Problem]) -> list[Block]:
    """Return all lines up to the program's end, with faults added to `faults`."""
    found: list[Block] = []
    percent = False
    for number, line in enumerate(text.splitlines(), 1):
        place = Place(file, number)
        if line.strip() == "%":
            # Between percent signs the program needs no end; what follows the second one is not part of it.
            if percent:
                break
            percent = True
            continue
        try:
            block = _block(line, place)
        except BadLine as fault:
            faults.append(fault.problem)
            if len(faults) >= MOST_FAULTS:
                break
            continue
        found.append(block)
        if block.code(Group.STOP) in {2.0, 30.0}:
            break
    return found


def _block(line: str, place: Place) -> Block:
    block = Block(place)
    for token in tokens(line, place):
        if isinstance(token, str):
            block.comments.append(token)
        elif token.letter in "GM":
            _take_code(block, token)
        elif token.letter not in codes.LETTERS:
            what = f"words with the letter {token.letter} are not read ({token.letter}{token.value:g})"
            raise place.fault(token.column, what, "post the program without it")
        elif token.letter in block.words:
            what = f"a second {token.letter} in one line"
            raise place.fault(token.column, what, "write one move per line")
        else:
            block.words[token.letter] = token
    return block


def _take_code(block: Block, word: Word) -> None:
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
