"""How names are written: in which order, and without what would drive a terminal."""

from __future__ import annotations

import re
from collections import defaultdict
from typing import TYPE_CHECKING, Protocol, TypeVar

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


_NUMBER = re.compile(r"(\d+)")


def natural(name: str) -> tuple[tuple[int, int, str], ...]:
    """Return a sort key: `w9` before `w10`."""
    parts = (part for part in _NUMBER.split(name) if part)
    return tuple((0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts)


def listed(names: Sequence[str], most: int, *, between: str = ", ") -> str:
    """Return the first names of a list as text, with the count of the others."""
    return between.join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def words(text: str) -> tuple[str, ...]:
    """Return the parts of a text that commas separate."""
    return tuple(text.split(", "))


class Repeated(Protocol):
    """A run with its test, direction and repeat."""

    @property
    def test(self) -> str:
        """Return the test's name."""
        ...

    @property
    def direction(self) -> str:
        """Return the sense of travel."""
        ...

    @property
    def repeat(self) -> int:
        """Return the number of the run of this test and direction."""
        ...


Run = TypeVar("Run", bound=Repeated)


def repeats_in_order(runs: Iterable[Run]) -> tuple[Run, ...]:
    """Return runs in their order, with the repeats of a test and direction in numerical order."""
    given = tuple(runs)
    alike: dict[tuple[str, str], list[Run]] = defaultdict(list)
    for run in given:
        alike[run.test, run.direction].append(run)
    next_of = {key: iter(sorted(repeats, key=lambda run: run.repeat)) for key, repeats in alike.items()}
    return tuple(next(next_of[run.test, run.direction]) for run in given)


_CONTROL = [*range(0x20), *range(0x7F, 0xA0)]
"""C0 and C1 controls and delete [ECMA-48]."""

_DIRECTION = [0x061C, 0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A)]
"""Marks and overrides of the direction of writing [Unicode TR9]."""

_LINES = [0x2028, 0x2029]
"""Characters that end lines and paragraphs."""

_HALVES = range(0xD800, 0xE000)
"""Halves of surrogate pairs: no encoding can write them."""


def _shown(code: int) -> str:
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"  # noqa: PLR2004 (two digits)


_ONE_LINE = {code: _shown(code) for code in (*_CONTROL, *_DIRECTION, *_LINES, *_HALVES)}
TEXT = {code: shown for code, shown in _ONE_LINE.items() if chr(code) not in "\n\t"}
"""Replacements of the characters that a text of several lines must not contain, for `str.translate`."""


_MANY = re.compile(rf"([{re.escape(''.join(map(chr, [*_CONTROL, *_DIRECTION, *_LINES, *_HALVES])))}])\1{{8,}}")
"""Pattern of nine or more equal escapes, as in a file that a disk has filled with zeros."""


def _counted(many: re.Match[str]) -> str:
    return many[0] if many[1] in "\n\t" else f"{many[1]} ({len(many[0])} times)"


def printable(text: str) -> str:
    r"""Return a text with `\x1b` in place of an escape character, and so on; `\n` and `\t` are kept."""
    return text if text.isascii() and text.isprintable() else _MANY.sub(_counted, text).translate(TEXT)


def on_one_line(text: str) -> str:
    r"""Return a name or cell as `printable` does, with `\x0a` in place of a line end."""
    return text if text.isascii() and text.isprintable() else _MANY.sub(_counted, text).translate(_ONE_LINE)
