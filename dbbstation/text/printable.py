r"""Make foreign text safe for a terminal: control characters are shown, not executed."""

from __future__ import annotations

import re

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
