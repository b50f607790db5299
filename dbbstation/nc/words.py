"""Write a toolpath as lines of words, with one method for each kind of row, of its name in small letters."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from io import StringIO
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from dbbstation.computing.compiled import compiled
from dbbstation.errors import StationError
from dbbstation.nc.dialect import Dialect, plain
from dbbstation.nc.spilled import LongText
from dbbstation.nc.toolpath import RowKind, in_last_decimals, rounded

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Flags, Integers
    from dbbstation.nc.dialect import Head
    from dbbstation.nc.toolpath import Toolpath

SIGNIFICANT_DIGITS = 7
"""Significant digits of feeds and dwells."""

MOST_LETTERS = 22
"""Of a number in an axis word: sign, point and the digits of 64 bits."""

_MINUS, _POINT, _ZERO, _LINE_FEED = b"-.0\n"

MOST_DECIMALS = 15
"""Greatest number of decimals of a feed or dwell: the length of a line is limited."""


def digits(value: float) -> str:
    """Return a number with seven significant digits and no exponent."""
    if value == 0.0:
        return "0"
    decimals = min(max(0, SIGNIFICANT_DIGITS - 1 - math.floor(math.log10(abs(value)))), MOST_DECIMALS)
    text = f"{value:.{decimals}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def number(value: float) -> str:
    """Return the shortest text without exponent that reads back as the same number."""
    return str(np.format_float_positional(value, trim="-"))


class CannotSayError(StationError):
    """The dialect has no words for a row."""

    def __init__(self, dialect: str, what: str, *, where: str = "") -> None:
        self.dialect, self.asked = dialect, what
        remedy = "remove it from the program, or write the program in a dialect that has it"
        super().__init__(f"the dialect {dialect} has no words for {what}", where=where, remedy=remedy)


class WordDialect(Dialect):
    """A dialect with lines of words; axes and F are written when they change."""

    words: ClassVar[Mapping[str, str]] = MappingProxyType({})
    """Text of `tcp on` and `tcp off`, which no dialect with plain axes has, of `begin`, `rapid` and `feed` ({words}), `in machine` ({move}), `exact`, `exact stop`, `continuous`, `within` ({mm}),
    `dwell` ({seconds}), `pause`, `pause with text` and `comment` and `message` ({text}), `optional stop`, and the ends `M2`, `M30`, `%`."""

    functions: ClassVar[str] = ""
    """Pattern of the words for spindle, coolant and tools."""

    systems: ClassVar[str] = ""
    """Pattern of work systems and tool lengths."""

    comment_letters: ClassVar[str] = " -~"
    """Letters that a comment may have, as in brackets of a regular expression; others become capitals or blanks."""

    instead: ClassVar[Mapping[str, str]] = MappingProxyType({})
    """Letters that would end a message, and their replacements."""

    longest_block: ClassVar[int] = 252
    """Greatest number of characters in a line."""

    axis_words: ClassVar[Sequence[str]] = tuple("XYZABC")
    """Text before the number of each axis, X, Y, Z [mm], A, B, C [deg]."""

    def write(self, toolpath: Toolpath, header: Sequence[str] = ()) -> str:
        """Return the program.

        Raises:
            CannotSayError: the dialect has no words for something in it.
        """
        return str(self._written(toolpath.parts(), lambda: (header, toolpath.numbers)))

    def write_parts(self, parts: Iterable[Toolpath], head: Head) -> LongText:
        """Return the program of a toolpath in parts, each written as soon as it is made."""
        return (self._written if type(self).write is WordDialect.write else super().write_parts)(parts, head)

    def _written(self, parts: Iterable[Toolpath], head: Head) -> LongText:
        # The header, which is known last, comes first.
        text, first, state = LongText(), None, _Modal()
        for part in parts:
            first = part if first is None else first
            text.add(self._checked(self._body(part, state)))
        if first is None:
            raise ValueError("a program needs a part")
        text.add(self._checked([*self._tcp("tcp off"), *self.end(first)]))
        header, numbers = head()
        text.first = self._checked(self._head(replace(first, numbers=numbers), header))
        return text

    def _tcp(self, what: str) -> list[str]:
        return [self.words[what]] if what in self.words else []

    def _checked(self, lines: Iterable[str]) -> bytes:
        """Return lines as UTF-8, each with a line feed."""
        text = StringIO()
        for line in lines:
            if len(line) > self.longest_block and max(map(len, line.split("\n"))) > self.longest_block:
                raise self.cannot_say(f"a line of more than {self.longest_block} characters")
            text.write(f"{line}\n")
        return text.getvalue().encode("utf-8", "surrogatepass")

    def _head(self, toolpath: Toolpath, header: Sequence[str]) -> Iterator[str]:
        yield from self.before_header(toolpath)
        for text in header:
            yield self.comment(text)
        if toolpath.holds is not None:
            yield from self.guard(toolpath.holds)
        corner_mm = toolpath.corner_mm
        around = [*self.begin(toolpath), *self._tcp("tcp on"), *([] if corner_mm is None else [self.corner(corner_mm)])]
        if toolpath.numbers and around:
            around[0] = f"{self.line_number(toolpath.numbers[0])}{around[0]}"
        yield from around

    def before_header(self, toolpath: Toolpath) -> Iterable[str]:  # noqa: ARG002
        """Return lines before the header's comments."""
        return ()

    def begin(self, toolpath: Toolpath) -> Iterable[str]:  # noqa: ARG002
        """Return lines that set all modes."""
        return (self.words["begin"],) if "begin" in self.words else ()

    def end(self, toolpath: Toolpath) -> Iterable[str]:
        """Return lines for `toolpath.ending`."""
        return (self._from_table(toolpath.ending.value, f"the end of a program by {toolpath.ending.value}"),)

    def line_number(self, line: int) -> str:
        """Return the number in front of a line."""
        return f"N{line} "

    def rapid(self, words: str) -> str:
        """Return a rapid with the words of the changed axes."""
        return self._from_table("rapid", "a rapid", words=words).rstrip()

    def feed(self, words: str, feed: float | None) -> str:
        """Return a move at a feed [mm/min; deg/min if only angles move]; feed None: unchanged."""
        line = self._from_table("feed", "a move at feed", words=words)
        return line if feed is None else f"{line} F{digits(feed)}"

    def in_machine(self, move: str) -> str:
        """Return a move in machine coordinates."""
        return self._from_table("in machine", "a move in machine coordinates (G53)", move=move)

    def corner(self, corner_mm: float) -> str:
        """Return the words for the rounding of all following corners [mm]: 0 exact, infinite unlimited."""
        if corner_mm <= 0.0:
            what, text = "exact" if corner_mm == 0.0 else "exact stop", ""
        else:
            what, text = ("continuous", "") if math.isinf(corner_mm) else ("within", digits(corner_mm))
        return self._from_table(what, "how far corners may be rounded", mm=text)

    def dwell(self, seconds: float) -> str:
        """Return a timed stop [s]."""
        return self._from_table("dwell", "a dwell", seconds=digits(seconds))

    def pause(self, text: str) -> str:
        """Return a stop for the operator, with a message if there is a text."""
        return self._from_table("pause with text" if text else "pause", "a stop", text=self.said(text))

    def optional_stop(self) -> str:
        """Return an optional stop."""
        return self._from_table("optional stop", "an optional stop (M1)")

    def comment(self, text: str) -> str:
        """Return a comment without effect."""
        allowed = re.compile(f"[{self.comment_letters}]")
        tried = ((letter, letter.upper(), " ") for letter in plain(text))
        text = "".join(next(filter(allowed.match, each), "") for each in tried)
        return self._from_table("comment", "a comment", text=text).rstrip()

    def message(self, text: str) -> str:
        """Return text that the control shows or logs: keyword, comma, text, as in `MSG, hello`."""
        return self._from_table("message", "a message without a stop", text=text)

    def function(self, words: str) -> str:
        """Return words for spindle and coolant that every control has, such as `S800 M3`."""
        if not all(re.fullmatch(self.functions, word) for word in words.split()):
            raise self.cannot_say(words)
        return words

    def system(self, text: str) -> str:
        """Return the words of a `SYSTEM` row: work system, offset or tool length."""
        if not re.fullmatch(self.systems, text):
            raise self.cannot_say(text)
        return text

    def said(self, text: str) -> str:
        """Return a text with only the letters that a message may have."""
        return "".join(self.instead.get(letter, letter) for letter in plain(text))

    def _from_table(self, what: str, lacking: str, **values: str) -> str:
        if what not in self.words:
            raise self.cannot_say(lacking)
        return self.words[what].format(**values)

    def guard(self, holds: Mapping[str, Sequence[float]]) -> Iterable[str]:  # noqa: ARG002
        """Return lines that end the program if offsets differ from `Toolpath.holds`; empty if it cannot."""
        return ()

    def length_guard(self, text: str, holds: Mapping[str, Sequence[float]], row: int) -> Iterable[str]:  # noqa: ARG002
        """Return the guard for a tool length that `text` activates."""
        return ()

    def cannot_say(self, what: str) -> CannotSayError:
        """Return the error for a row without words in this dialect."""
        return CannotSayError(self.name, what)

    def _body(self, toolpath: Toolpath, state: _Modal) -> Iterator[str]:
        # What does not move by the decimals that are written does not move.
        toolpath = toolpath.with_numbers(rounded(toolpath.numbers_written, self.decimals))
        if not state.rows:
            state.corner_mm = math.nan if toolpath.corner_mm is None else toolpath.corner_mm
            state.pose = np.full(6, np.nan) if toolpath.start is None else toolpath.start
        words = self._words(toolpath, changed_axes(toolpath, state))
        # Most rows only have other axes than the row before: a table's words stand beside these.
        of_table = self.words.get("feed", "") if type(self).feed is WordDialect.feed else ""
        plain_feed = of_table.split("{words}") if of_table.count("{") == 1 else []
        kinds, feeds = toolpath.kind.tolist(), toolpath.feed.tolist()
        corners, in_machine = toolpath.corners_mm.tolist(), toolpath.in_machine.tolist()
        ends = _ends_of_plain(toolpath) if plain_feed else []
        done = 0
        for row, kind in enumerate(kinds):
            if row < done:
                continue
            if ends and ends[row] > row:
                done = ends[row]
                lines = f"{plain_feed[-1]}\n{plain_feed[0]}".join(words[row:done])
                yield f"{plain_feed[0]}{lines}{plain_feed[-1]}"
                continue
            try:
                if kind not in _MOVES:
                    yield self._row(RowKind(kind), toolpath, row)
                    if kind == RowKind.SYSTEM:
                        yield from self.length_guard(toolpath.text[row], toolpath.holds or {}, state.rows + row)
                    continue
                if corners[row] != state.corner_mm and not math.isnan(corners[row]):
                    state.corner_mm = corners[row]
                    yield self.corner(corners[row])
                line = self._move(kind, words[row], feeds[row], state)
                yield self.in_machine(line) if in_machine[row] else line
            except CannotSayError as error:
                raise CannotSayError(error.dialect, error.asked, where=toolpath.where(row)) from None
        state.rows += len(kinds)

    def _move(self, kind: int, words: str, feed: float, state: _Modal) -> str:
        if kind == RowKind.RAPID:
            return self.rapid(words)
        changed = None if feed == state.feed else feed
        state.feed = feed
        return self.feed(words, changed)

    def _row(self, kind: RowKind, toolpath: Toolpath, row: int) -> str:
        text = toolpath.text.get(row, "")
        if kind == RowKind.DWELL:
            return self.dwell(float(toolpath.dwell_s[row]))
        if kind == RowKind.OPTIONAL_STOP:
            return self.optional_stop()
        written: Callable[[str], str] = getattr(self, kind.name.lower())
        return written(text)

    def _words(self, toolpath: Toolpath, changed: Flags) -> list[str]:
        numbers = in_last_decimals(toolpath.numbers_written, self.decimals)
        names = [f" {word}".encode() for word in self.axis_words]
        ends = np.cumsum([0, *map(len, names)])
        letters = np.empty(len(numbers) * (int(ends[-1]) + len(names) * MOST_LETTERS + 1), dtype=np.uint8)
        name_letters = np.frombuffer(b"".join(names), dtype=np.uint8)
        end = _write(numbers, changed, name_letters, ends, np.array(self.decimals), letters)
        return letters[:end].tobytes().decode().split("\n")[:-1]


@compiled
def _write(
    numbers: Integers,
    changed: Flags,
    names: NDArray[np.uint8],
    ends: Integers,
    decimals: Integers,
    letters: NDArray[np.uint8],
) -> int:
    """Write the changed axes of each row, their numbers in last decimals, a line feed behind each; return where the text ends."""
    at = 0
    for row in range(len(numbers)):
        first = at
        for axis in range(numbers.shape[1]):
            if not changed[row, axis]:
                continue
            begin = ends[axis] + (at == first)  # no blank before the first word
            for k in range(begin, ends[axis + 1]):
                letters[at] = names[k]
                at += 1
            number = numbers[row, axis]
            if number < 0:
                letters[at] = _MINUS
                at += 1
                number = -number
            count, rest = 1, number // 10
            while rest > 0 or count <= decimals[axis]:
                count, rest = count + 1, rest // 10
            end = at + count + (decimals[axis] > 0)
            for k in range(count):
                if k == decimals[axis] and k > 0:
                    end -= 1
                    letters[end] = _POINT
                end -= 1
                letters[end] = _ZERO + number % 10
                number //= 10
            at += count + (decimals[axis] > 0)
        letters[at] = _LINE_FEED
        at += 1
    return at


def _ends_of_plain(toolpath: Toolpath) -> list[int]:
    """Return the end of the stretch of plain moves that each row begins, as an index among these rows; the row itself if it changes more than axes."""
    kind, feed, corner = toolpath.kind, toolpath.feed, toolpath.corners_mm
    plain = np.zeros(len(kind) + 1, dtype=np.bool_)
    same = (kind[1:] == RowKind.FEED) & (kind[:-1] == RowKind.FEED) & (feed[1:] == feed[:-1])
    plain[1:-1] = same & ((corner[1:] == corner[:-1]) | np.isnan(corner[1:])) & ~toolpath.in_machine[1:]
    stops = np.flatnonzero(~plain)
    return stops[np.searchsorted(stops, np.arange(len(kind)))].tolist()


class _Modal:
    """State at the end of a part of a program, for the next part: pose with NaN for unknown axes, shape (6,), and number of rows."""

    def __init__(self) -> None:
        self.feed = self.corner_mm = math.nan
        self.pose = np.full(6, np.nan)
        self.rows = 0


_MOVES = frozenset((int(RowKind.RAPID), int(RowKind.FEED)))


SAME = 1e-9
"""Positions that differ by less are equal: numbers and offsets have fifteen digits [mm, deg]."""


def changed_axes(toolpath: Toolpath, state: _Modal) -> Flags:
    """Return axes that each row must name, shape (n, 6); none in rows that are no moves."""
    moves = np.flatnonzero(toolpath.is_move)
    poses = toolpath.poses[moves]
    known = (toolpath.unknown[moves][:, None] >> np.arange(6)) & 1 == 0
    before = np.vstack([state.pose, poses])
    was_known = np.vstack([~np.isnan(state.pose), known])
    state.pose = np.where(was_known[-1], before[-1], np.nan)
    before, was_known = before[:-1], was_known[:-1]
    must = known & (~was_known | ~(np.abs(poses - before) <= SAME))
    # A move to where the machine stands already is a move: most controls want an axis in it.
    stays = ~must.any(axis=1)
    must[stays] = known[stays] & (np.cumsum(known[stays], axis=1) == 1)
    named = np.zeros((len(toolpath), 6), dtype=np.bool_)
    named[moves] = must
    return named
