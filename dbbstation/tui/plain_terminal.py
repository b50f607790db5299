"""Characters for limited terminals: without UTF-8, or a Linux console without braille; control characters are shown."""

from __future__ import annotations

import os
import re
import sys
import unicodedata
from typing import TYPE_CHECKING, cast

from rich import control
from textual import content

from dbbstation.text.written import TEXT
from dbbstation.tui.braille import BLANK

if TYPE_CHECKING:
    from textual.driver import Driver

_BRAILLE = re.compile(f"[{chr(BLANK)}-{chr(BLANK + 0xFF)}]")
_FOREIGN = re.compile(r"[^\x00-\x7f]")

_DOTS = " .:*"
"""Characters by the number of raised dots: zero, one or two, three or four, more."""

_ALIKE = dict(zip("µ°±…·→›▸▶–×●○✓√⇧│┃║▊▎▌▐▏▕─━═▔▁▂┄┈", "uo~..>>>>-x@ovv^|||||||||--------", strict=True))


def plain_driver(usual: type[Driver]) -> type[Driver]:
    """Return a driver that writes only this terminal's characters and keeps the layout."""
    encoding = getattr(sys.__stderr__, "encoding", None) or ""  # where Textual draws
    every = "utf" not in encoding.lower() or _foreign_locale()
    if not every and os.environ.get("TERM") != "linux":
        return usual

    class PlainDriver(usual):  # type: ignore[valid-type, misc]  # the system's own driver
        def write(self, data: str) -> None:
            super().write(plain(data) if every else without_braille(data))

    return PlainDriver


def _foreign_locale() -> bool:
    """Return whether the terminal has another encoding than Python, which uses UTF-8 if it lacks the locale [PEP 538, 540]."""
    taken = os.environ.get("LC_CTYPE", "")
    named = os.environ.get("LC_ALL") or ("" if taken == "C.UTF-8" else taken) or os.environ.get("LANG") or taken
    return bool(named) and "utf" not in named.lower() and bool(sys.flags.utf8_mode) and "PYTHONUTF8" not in os.environ


def without_braille(text: str) -> str:
    """Return a text with one ASCII character in place of each cell of dots."""
    return _BRAILLE.sub(lambda cell: _DOTS[min(((ord(cell[0]) - BLANK).bit_count() + 1) // 2, 3)], text)


def plain(text: str) -> str:
    """Return a text in ASCII, character by character."""
    return _FOREIGN.sub(_alike, without_braille(text))


def _alike(found: re.Match[str]) -> str:
    character = found[0]
    if character in _ALIKE:
        return _ALIKE[character]
    if "\u2500" <= character <= "\u257f":
        return "+"
    if "\u2580" <= character <= "\u259f":
        return "#"
    first = unicodedata.normalize("NFKD", character)[0]
    return first if first.isascii() else "?"


def show_controls() -> None:
    """Let Textual and Rich show control characters."""
    for table in (content._CONTROL_STRIP_TRANSLATE, control._CONTROL_STRIP_TRANSLATE):  # noqa: SLF001 (no other way in)
        cast("dict[int, str]", table).update(TEXT)
