"""How names and numbers are written: in which order, with which digits, and without what would drive a terminal."""

from __future__ import annotations

import math
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


MOST_DECIMALS = 3
"""Decimals of the finest figures, in µm: a nanometre."""

SIGNIFICANT = 2
"""Number of significant digits of an uncertainty."""


def expanded_uncertainty(u: float | None, coverage_factor: float) -> float | None:
    """Return U = k u; None if u is not known."""
    return None if u is None else coverage_factor * u


LONGEST = 6
"""Number of decimals or rounded zeros above which a number has an exponent."""


def decimals_of(expanded: float) -> int:
    """Return the decimals of a value with this expanded uncertainty."""
    return min(max(_place(expanded), 0), MOST_DECIMALS) if expanded > 0.0 else MOST_DECIMALS


def _place(uncertainty: float) -> int:
    """Return the decimal place of an uncertainty's last significant digit."""
    shown = float(f"{uncertainty:.{SIGNIFICANT - 1}e}")  # 0.0996 is written as 0.10
    return SIGNIFICANT - 1 - math.floor(math.log10(shown))


def to_its_place(value: float, uncertainty: float) -> tuple[str, str]:
    """Return a value and its uncertainty, rounded to two significant digits of the uncertainty [GUM 7.2.6]."""
    if not (0.0 < uncertainty < math.inf and math.isfinite(value)):
        return f"{value:.4g}", f"{uncertainty:.2g}"
    place = _place(uncertainty)
    if abs(place) <= LONGEST:
        rounded = (round(value, place), round(uncertainty, place))
        return f"{rounded[0]:z.{max(place, 0)}f}", f"{rounded[1]:.{max(place, 0)}f}"
    digits = 0 if value == 0.0 else math.floor(math.log10(abs(value))) + place
    return f"{value:z.{max(digits, 0)}e}", f"{uncertainty:.{SIGNIFICANT - 1}e}"


def with_uncertainty(value: float, expanded: float | None) -> tuple[str, str]:
    """Return a value and its expanded uncertainty as text with the same decimals."""
    if expanded is None:
        return f"{value:z.1f}", "-"
    decimals = decimals_of(expanded)
    return f"{value:z.{decimals}f}", f"{expanded:.{decimals}f}"


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
