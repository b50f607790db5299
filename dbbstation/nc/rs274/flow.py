"""Lines of a program in execution order, with O-words, subprograms and parameters."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dbbstation.errors import Problem
from dbbstation.nc.rs274.blocks import BLANKS
from dbbstation.nc.rs274.lines import ProgramLines, plain_lines
from dbbstation.nc.rs274.tokens import BadLine, Place, ValueReader
from dbbstation.nc.setup import ControlSetup
from dbbstation.nc.spilled import LongText

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from dbbstation.nc.rs274.lines import PlainLines

MOST_AGAIN = 500_000
"""Greatest number of repeated lines in loops and subprograms. A program that repeats more is assumed to run for
ever."""

DEEPEST = 10
"""Greatest depth of nested subprograms [LinuxCNC, INTERP_SUB_ROUTINE_LEVELS]."""

MOST_NUMBER = 9999
"""Greatest number of a subprogram. In P, the digits before it are the number of its repetitions [Fanuc, M98]."""

LOCAL = 30
"""Parameters with numbers up to this belong to the running subprogram."""

_O_LINE = re.compile(
    r"[ \t]*(?:[nN][ \t]*[0-9]+[ \t]*)?[oO][ \t]*(?P<label><[^>]*>|[0-9]+)[ \t]*(?P<keyword>[A-Za-z]*)(?P<rest>.*)",
    re.DOTALL,
)
_KEYWORDS = frozenset(
    "sub endsub return call if elseif else endif while endwhile do repeat endrepeat break continue".split()  # noqa: SIM905 - words
)
_MACRO = re.compile(
    r"[ \t]*(?:N[ \t]*[0-9]+[ \t]*)?(?P<word>WHILE|IF|GOTO|END(?=[ \t]*[0-9]+[ \t]*(?:[;(]|\r?$)))(?P<rest>.*)",
    re.IGNORECASE | re.DOTALL,
)
_LETTERS_OF_FLOW = np.isin(np.arange(256), np.frombuffer(b"OoIiDd", dtype=np.uint8))
_DO = re.compile(r"\bDO[ \t]*(?P<number>[0-9]+)\Z", re.IGNORECASE)
_GOTO = re.compile(r"\A[ \t]*(?:GOTO)?[ \t]*(?P<number>[0-9]+)\Z", re.IGNORECASE)
_END = re.compile(r"\A[ \t]*(?P<number>[0-9]+)\Z")
_THEN = re.compile(r"[ \t]*THEN(?=[ \t]*#)", re.IGNORECASE)
_NUMBERED = re.compile(r"(?im)^[ \t]*N[ \t]*([0-9]+)")
_SKIPPED = re.compile(r"[ \t]*/")
_COMMENT = re.compile(r"\([^()]*\)|;.*")


class OLine(NamedTuple):
    """A line that begins with an O-word.

    Attributes:
        line: from 1.
        keyword: in small letters; empty for the number of a program.
        column: at which `rest` begins, from 0.
    """

    line: int
    label: str
    keyword: str
    rest: str
    column: int


@dataclass(slots=True)
class _Frame:
    """A running subprogram: place of its call, remaining repetitions, and parameters."""

    back: int
    begin: int
    again: int
    by_number: bool
    number: int
    parameters: dict[int | str, float] = field(default_factory=dict)


class Flow:
    """Runs a program line by line.

    Args:
        text: as UTF-8, shape (n,).
        outer: value of a parameter of the control; None if undefined.

    Attributes:
        files: lines before each file, and its name: the program first, then subprograms that it called.
    """

    def __init__(
        self,
        text: NDArray[np.uint8],
        file: str,
        outer: Callable[[int | str], float | None],
        setup: ControlSetup | None = None,
    ) -> None:
        self._outer, self._setup = outer, setup or ControlSetup()
        self._o_lines: dict[int, OLine] = {}
        self._macros: dict[int, OLine] = {}
        self._labels: dict[str, list[OLine]] = {}
        self._lines = ProgramLines()
        self.files: tuple[tuple[int, str], ...] = ()
        self._append(text, file)
        self._own_lines = self._count
        self.percent, self._next = self._opening()
        self._frames: list[_Frame] = []
        self._globals: dict[int | str, float] = {}
        self._counts: dict[tuple[int, int], int] = {}
        self._begun = self.closed = False
        self._entered = 0
        self._ran = 0

    def _append(self, text: NDArray[np.uint8], file: str) -> None:
        self.files += ((self._count, file),)
        # Every word of the flow has one of these letters, and few other lines have one.
        for at, line in self._lines.append(text, _LETTERS_OF_FLOW):
            self._take_word(line, at + 1)

    @property
    def _count(self) -> int:
        """Return the number of lines of all files so far."""
        return len(self._lines)

    def _found(self, label: str, keyword: str) -> list[OLine]:
        """Return the begin of a subprogram; if it is in no line, look for its file."""
        stem, begun = label.strip("<>"), {file for _, file in self.files}
        for name in (stem, f"o{stem}", f"{stem:0>4}", f"o{stem:0>4}"):
            if any(one.keyword == keyword for one in self._labels.get(label, [])):
                break
            file, text = self._setup.subprogram(name) or ("", "")
            if file and file not in begun:
                self._append(
                    LongText.of("\n".join("" if is_percent(line) else line for line in text.split("\n"))).letters, file
                )
        return [one for one in self._labels.get(label, []) if one.keyword == keyword]

    def _place(self, line: int) -> Place:
        before, file = next(each for each in reversed(self.files) if each[0] < line)
        return Place(file, line, line - before if before else 0)

    def lines(self) -> Iterator[tuple[str, Place]]:
        """Yield lines without O-words in execution order.

        Raises:
            BadLine: an O-word that makes no sense, or the program does not end.
        """
        last = next((at for at in range(self._own_lines, 0, -1) if self._lines[at - 1].strip(BLANKS)), 1) - 1
        # Past its last line a file does not go on in the next one.
        while self._next < self._count and not (self._next and any(self._next == at for at, _ in self.files)):
            self._ran += 1
            place = self._place(self._next + 1)
            if self._ran > self._count + MOST_AGAIN:
                what = f"its loops and subprograms run more than {MOST_AGAIN} lines: they may never end"
                raise place.fault(1, what, "check the conditions of its loops")
            line = self._lines[self._next]
            self._next += 1
            skipped = _SKIPPED.match(line)
            if skipped is not None and self._setup.block_delete is not None:
                if self._setup.block_delete:
                    continue
                line = f"{skipped[0][:-1]} {line[skipped.end() :]}"
            word = self._o_lines.get(self._next)
            macro = self._macros.get(self._next)
            if word is not None:
                self._run(word, place)
            elif macro is not None:
                line = self._run_macro(macro, place)
                if line:
                    yield line, place
            elif is_percent(line) and (self.percent or self._next > last):
                self.closed = True
                return
            else:
                self._begun |= bool(_COMMENT.sub("", line).strip(BLANKS))
                yield line, place

    def plain_lines(self) -> PlainLines:
        """Return the content of the plain lines from the last yielded line on."""
        return plain_lines(*self._lines.letters_from(self._next - 1))

    def skip(self, lines: int) -> None:
        """Mark the next lines as run."""
        self._next += lines
        self._ran += lines

    @property
    def runs(self) -> list[int]:
        """Return the running subprograms, each call by a separate number; 0 is the program."""
        return [0, *(frame.number for frame in self._frames)]

    def ended(self) -> None:
        """Check after M2 and M30 that the program is complete.

        Raises:
            BadLine: the closing percent sign is missing.
        """
        if self.percent and not any(is_percent(self._lines[at]) for at in range(self._opening()[1], self._own_lines)):
            raise BadLine(self.cut_short())

    def all_lines(self) -> Iterator[tuple[str, Place]]:
        """Yield all lines without O-words in file order, up to the closing percent sign."""
        begin = self._opening()[1]
        for number in range(begin + 1, self._own_lines + 1):
            line = self._lines[number - 1]
            if self.percent and is_percent(line):
                return
            if number not in self._o_lines and number not in self._macros:
                yield line, self._place(number)

    def value_of(self, which: int | str) -> float | None:
        """Return the value of a parameter, None if undefined."""
        own = self._frames[-1].parameters if self._frames and _is_local(which) else self._globals
        if which in own:
            return own[which]
        if own is not self._globals and not self._frames[-1].by_number:
            return None
        return self._outer(which)

    def set(self, which: int | str, value: float) -> None:
        """Set a parameter's value."""
        (self._frames[-1].parameters if self._frames and _is_local(which) else self._globals)[which] = value

    def call(self, number: float, times: float, place: Place) -> None:
        """Go to a subprogram by its number (M98).

        Raises:
            BadLine: the program has none of this number.
        """
        if number > MOST_NUMBER and times == 1.0 and f"{number:.0f}" not in self._labels:
            times, number = divmod(number, MOST_NUMBER + 1.0)
        found = self._found(f"{number:.0f}", "")
        if len(found) != 1 or number != int(number):
            what = f"M98 calls the subprogram O{number:g}, of which there is {'none' if not found else 'more than one'}"
            raise place.fault(
                1, what, f"put it behind M30, from O{number:g} to M99, or give its folder with --subprograms"
            )
        if times >= 1.0:
            self._enter(found[0].line, int(times) - 1, place, by_number=True, parameters=dict(self._own()))

    def back(self, place: Place) -> None:
        """Return from a subprogram that was called by its number (M99).

        Raises:
            BadLine: none runs.
        """
        if not self._frames or not self._frames[-1].by_number:
            raise place.fault(1, "M99 in a main program repeats the program endlessly", "end it with M2 or M30")
        self._leave(place)

    def _own(self) -> dict[int | str, float]:
        own = self._frames[-1].parameters if self._frames else self._globals
        return {which: value for which, value in own.items() if _is_local(which)}

    def _opening(self) -> tuple[bool, int]:
        """Return whether the first line with content is a percent sign, and the index of the first line to read.

        A program between percent signs needs no other end. Elsewhere LinuxCNC treats a percent sign as a fault.
        """
        start = next((at for at in range(self._count) if self._lines[at].strip(BLANKS)), 0)
        return (True, start + 1) if is_percent(self._lines[start]) else (False, 0)

    def cut_short(self) -> Problem:
        """Return the fault of a program without an end."""
        end = "the % that closes it" if self.percent else "M2 or M30"
        what = f"the program ends without {end}: it may have been cut short"
        return Problem(self.files[0][1], self._own_lines, 0, what, "copy it again, or add its end if it is complete")

    def _take_word(self, text: str, line: int) -> None:
        word, macro = _O_LINE.match(text), _MACRO.match(text)
        if word:
            label, column = re.sub(r"\s", "", word["label"]).lower(), word.start("rest")
            rest = _COMMENT.sub(lambda comment: " " * len(comment[0]), word["rest"]).rstrip(BLANKS)
            label = label if label[0] == "<" else str(int(label))
            self._o_lines[line] = OLine(line, label, word["keyword"].lower(), rest, column)
            self._labels.setdefault(label, []).append(self._o_lines[line])
        elif macro:
            rest = _COMMENT.sub("", macro["rest"]).rstrip(BLANKS)
            self._macros[line] = OLine(line, "", macro["word"].upper(), rest, macro.start("rest"))

    def _run(self, word: OLine, place: Place) -> None:
        if word.keyword and word.keyword not in _KEYWORDS:
            raise place.fault(word.column, f"O-words have no {word.keyword!r}", "check its spelling")
        made = getattr(self, f"_{word.keyword or 'number'}", self._if)
        made(word, place)

    def _run_macro(self, macro: OLine, place: Place) -> str:
        """Run WHILE, IF, GOTO or END of Fanuc's macros; if an IF is true, return the line behind its THEN."""
        self._begun = True
        reader = self._reader(macro, place)
        holds = macro.keyword not in {"WHILE", "IF"} or reader.bracket() != 0.0
        rest = macro.rest[reader.position - macro.column :] if reader.position else macro.rest
        then = _THEN.match(rest) if macro.keyword == "IF" else None
        if then is not None:
            return (
                f"{'':{macro.column + len(macro.rest) - len(rest) + then.end()}}{rest[then.end() :]}" if holds else ""
            )
        target = (_DO if macro.keyword == "WHILE" else _GOTO).search(rest)
        if target is None:
            raise place.fault(
                macro.column + 1, f"{macro.keyword} is incomplete", "write WHILE [#1 LT 5] DO1, or GOTO 10"
            )
        number = int(target["number"])
        if macro.keyword == "WHILE":
            self._next = self._next if holds else self._loop_line(macro, number, place, "END").line
        elif macro.keyword == "END":
            self._next = self._loop_line(macro, number, place, "WHILE").line - 1
        elif holds:
            self._next = self._numbered(number, place)
        return ""

    def _program(self) -> range:
        begins = [1 + before for before, _ in self.files] + [
            each.line for each in self._o_lines.values() if not each.keyword
        ]
        return range(
            max(line for line in begins if line <= self._next),
            min((line for line in begins if line > self._next), default=self._count + 1),
        )

    def _loop_line(self, macro: OLine, number: int, place: Place, keyword: str) -> OLine:
        form = _END if keyword == "END" else _DO
        near = [
            one
            for one in self._macros.values()
            if one.keyword == keyword and (one.line > macro.line) == (keyword == "END") and one.line in self._program()
            if (found := form.search(one.rest)) and int(found["number"]) == number
        ]
        if not near:
            raise place.fault(1, f"{macro.keyword} of loop {number} has no {keyword}", "add it")
        return near[0 if keyword == "END" else -1]

    def _numbered(self, number: int, place: Place) -> int:
        """Return the index of the next line with this number; after the last line the search continues at the first [Fanuc, GOTO]."""
        found = ((line, _NUMBERED.match(self._lines[line - 1])) for line in self._program())
        lines = [line - 1 for line, match in found if match and int(match[1]) == number]
        if not lines:
            raise place.fault(1, f"GOTO {number}: no line has the number N{number}", "add it")
        return next((at for at in lines if at >= self._next), lines[0])

    def _number(self, word: OLine, place: Place) -> None:
        """Handle the program's number. A later number begins a subprogram, which runs only when called."""
        if word.rest:
            raise place.fault(
                word.column + 1,
                "the line has more than the number of a program",
                "write the number in a separate line",
            )
        if self._begun:
            raise place.fault(1, f"the program runs into the subprogram O{word.label}", "end it with M2 or M30 before")

    def _sub(self, word: OLine, place: Place) -> None:
        self._next = self._find(word, place, ("endsub",)).line

    def _call(self, word: OLine, place: Place) -> None:
        subs = self._found(word.label, "sub")
        if len(subs) != 1:
            what = f"the subprogram O{word.label} is {'not in this file' if not subs else 'in it more than once'}"
            raise place.fault(
                1, what, "write it there once, from its sub to its endsub, or give its folder with --subprograms"
            )
        given, reader = [], self._reader(word, place)
        while reader.blanks() == "[":
            given.append(reader.bracket())
        if reader.blanks() or len(given) > LOCAL:
            raise place.fault(reader.position + 1, "a call allows only values in brackets", "write o100 call [1] [2]")
        parameters: dict[int | str, float] = dict.fromkeys(range(1, LOCAL + 1), 0.0)
        self._enter(subs[0].line, 0, place, by_number=False, parameters=parameters | dict(enumerate(given, 1)))

    def _enter(
        self, begin: int, again: int, place: Place, *, by_number: bool, parameters: dict[int | str, float]
    ) -> None:
        if len(self._frames) >= DEEPEST:
            raise place.fault(1, f"more than {DEEPEST} nested subprograms", "check what calls itself")
        self._entered += 1
        self._frames.append(_Frame(self._next, begin, again, by_number, self._entered, parameters))
        self._next = begin

    def _leave(self, place: Place) -> None:
        if not self._frames:
            raise place.fault(1, "the end of a subprogram that was not called", "remove it")
        frame = self._frames[-1]
        if frame.again:
            frame.again -= 1
            self._next = frame.begin
            return
        self._frames.pop()
        if frame.by_number:  # it has the parameters of its caller
            for which, value in frame.parameters.items():
                self.set(which, value)
        self._next = frame.back

    def _endsub(self, word: OLine, place: Place) -> None:
        if word.rest:
            reader = self._reader(word, place)
            self._globals["_value"] = reader.value()
        self._globals["_value_returned"] = float(bool(word.rest))
        self._leave(place)

    _return = _endsub

    def _if(self, word: OLine, place: Place) -> None:
        if word.keyword in {"else", "elseif"}:
            self._next = self._find(word, place, ("endif",)).line
            return
        if word.keyword == "endif" or self._holds(word, place):
            return
        branch = self._find(word, place, ("elseif", "else", "endif"))
        while branch.keyword == "elseif" and not self._holds(branch, self._place(branch.line)):
            branch = self._find(branch, place, ("elseif", "else", "endif"))
        self._next = branch.line

    def _while(self, word: OLine, place: Place) -> None:
        opened = self._opened(word, ("do",))
        if opened is not None:  # the end of do … while
            self._next = opened.line if self._holds(word, place) else self._next
        elif not self._holds(word, place):
            self._next = self._find(word, place, ("endwhile",)).line

    def _endwhile(self, word: OLine, place: Place) -> None:
        self._next = self._must_be_opened(word, place, ("while",)).line - 1

    def _do(self, _word: OLine, _place: Place) -> None:
        """Begin a loop; its `while` jumps back."""

    def _repeat(self, word: OLine, place: Place) -> None:
        times = self._reader(word, place).value()
        self._counts[len(self._frames), word.line] = int(times)
        if times < 1.0:
            self._next = self._find(word, place, ("endrepeat",)).line

    def _endrepeat(self, word: OLine, place: Place) -> None:
        begin = self._must_be_opened(word, place, ("repeat",))
        key = len(self._frames), begin.line
        self._counts[key] = self._counts.get(key, 1) - 1
        if self._counts[key] > 0:
            self._next = begin.line

    def _break(self, word: OLine, place: Place) -> None:
        end = self._find(word, place, ("endwhile", "endrepeat", "while"))
        self._next = end.line - (word.keyword == "continue")

    _continue = _break

    def _find(self, word: OLine, place: Place, keywords: tuple[str, ...]) -> OLine:
        for each in self._labels[word.label]:
            if each.line > word.line and each.keyword in keywords:
                return each
        raise place.fault(1, f"O{word.label} {word.keyword} has no {' or '.join(keywords)}", "add it")

    def _opened(self, word: OLine, keywords: tuple[str, ...]) -> OLine | None:
        """Return the preceding O-word of this label if it has one of the keywords; skip breaks and continues."""
        before = [each for each in self._labels[word.label] if each.line < word.line]
        before = [each for each in before if each.keyword not in {"break", "continue"}]
        return before[-1] if before and before[-1].keyword in keywords else None

    def _must_be_opened(self, word: OLine, place: Place, keywords: tuple[str, ...]) -> OLine:
        opened = self._opened(word, keywords)
        if opened is None:
            raise place.fault(1, f"O{word.label} {word.keyword} without its {keywords[0]}", "add it")
        return opened

    def _holds(self, word: OLine, place: Place) -> bool:
        reader = self._reader(word, place)
        value = reader.value()
        if reader.blanks() or math.isnan(value):
            raise place.fault(reader.position + 1, "a condition is one value in brackets", "write o100 if [#1 GT 2]")
        return value != 0.0

    def _reader(self, word: OLine, place: Place) -> ValueReader:
        return ValueReader(" " * word.column + word.rest, place, self.value_of)


def _is_local(which: int | str) -> bool:
    return which <= LOCAL if isinstance(which, int) else not which.startswith("_")


def is_percent(line: str) -> bool:
    """Return whether a line is a percent sign alone."""
    return line.strip(BLANKS) == "%"
