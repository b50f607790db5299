"""The guard of a program: O-words that stop it if a LinuxCNC offset is not zero.

Parameters [LinuxCNC, G-code overview, Numbered Parameters]: #5220 is the number n of the work system in force, 1 to 9;
#5201 + 20 n and the next eight are its offsets in X to W, #5210 + 20 n its rotation about Z; #5211 to #5219 are G92;
#<_tool_offset> is 1 while a tool length is in force.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from dbbstation.nc.toolpath import SYSTEMS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

FIRST_LABEL = 100

_SYSTEM, _PER_SYSTEM = 5200, 20
_TERMS = 5
"""In one line; a line of LinuxCNC has an end."""

_WORK = (
    "work system {} is not zero: this program is in machine coordinates. Clear offsets and rotation, then start again"
)
_G92 = "G92 is not zero: this program is in machine coordinates. Clear it with G92.1, then start again"
_TOOL = "a tool length is in force: this program is for the tool tip of the machine model. Cancel it with G49, then start again"


def guard_lines(systems: Sequence[str] = ()) -> tuple[str, ...]:
    """Return a guard for the work system in force and those named, `G54` to `G59.3`."""
    offsets = range(1, 11)  # X to W, and the rotation
    checks = [([f"#[{_SYSTEM + k}+{_PER_SYSTEM}*#5220]" for k in offsets], _WORK.format("in force"))]
    for name in systems:
        base = _SYSTEM + _PER_SYSTEM * (SYSTEMS.index(name) + 1)
        checks.append(([f"#{base + k}" for k in offsets], _WORK.format(name)))
    checks.append(([f"#{parameter}" for parameter in range(5211, 5220)], _G92))
    checks.append((["#<_tool_offset>"], _TOOL))
    lines: list[str] = []
    label = FIRST_LABEL
    for parameters, message in checks:
        for first in range(0, len(parameters), _TERMS):
            condition = " OR ".join(f"[{one} NE 0]" for one in parameters[first : first + _TERMS])
            lines += [f"o{label} if [{condition}]", f"(MSG, {message})", "M0", "M02", f"o{label} endif"]
            label += 1
    return tuple(lines)


_NAMED = re.compile(r"if\[\[#(\d{4})ne0\]")
_OF_A_GUARD = re.compile(r"o\d+|m0$|m02$")


def guard_at(lines: Sequence[str]) -> tuple[tuple[str, ...], int] | None:
    """Return the guard at the beginning of lines: its systems and line count, or None.

    Comments, blanks, line numbers and letter case are ignored.
    """
    found: list[tuple[int, str]] = []
    systems: list[str] = []
    for place, text in _bare(lines):
        if not _OF_A_GUARD.match(text) or (place > 0 and not found):
            break
        found.append((place, text))
        named = _NAMED.search(text)
        system, offset = divmod(int(named[1]) - _SYSTEM, _PER_SYSTEM) if named else (0, 0)
        if offset == 1 and 1 <= system <= len(SYSTEMS):
            systems.append(SYSTEMS[system - 1])
    expected = [text for _, text in _bare(guard_lines(systems))]
    if [text for _, text in found[: len(expected)]] != expected:
        return None
    return tuple(systems), found[len(expected) - 1][0] + 1


def _bare(lines: Sequence[str]) -> Iterator[tuple[int, str]]:
    """Return number and text of lines with content, without blanks and line numbers, in small letters."""
    for place, line in enumerate(lines):
        text = re.sub(r"\([^()]*\)|;.*|\s+", "", line).lower()
        text = re.sub(r"^n\d+", "", text)
        if text:
            yield place, text
