"""The guard of a program: O-words that stop it unless LinuxCNC's offsets are as assumed.

Parameters [LinuxCNC, G-code overview, Numbered Parameters]: #5220 is the number n of the active work system, 1 to 9;
#5201 + 20 n and the next eight are its offsets in X to W, #5210 + 20 n its rotation about Z; #5211 to #5219 are G92,
#5401 to #5409 the active tool length, #<_tool_offset> is 1 if there is one. All are in the machine's units.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.nc.rs274.state import LENGTH, SYSTEM
from dbbstation.nc.setup import FIRST_PARAMETERS, PER_SYSTEM, ZERO, offset_text
from dbbstation.nc.toolpath import IN_FORCE, MESSAGE, SYSTEMS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

FIRST_LABEL, FIRST_LENGTH_LABEL = 100, 1000

WITHIN = 5e-4
"""Largest sum of all differences between actual and declared offsets [mm, deg]."""

_IN_FORCE = FIRST_PARAMETERS[SYSTEMS[0]] - PER_SYSTEM
"""Parameter of X in work system 0; each work system adds 20."""

_AXES = 9
_TERMS = 5
"""Number of terms in one line, since the length of LinuxCNC's lines is limited."""

_WORK = "work system {} is not {}: this program is right for that only. Set it, or compensate anew"
_OTHER = "G92 is not {}. Clear it with G92.1, or compensate anew"
_TOOL = "a tool length is in force: this program has none. Cancel it with G49, then start again"
_LENGTHS = "the length of tool {} is not {}. Compensate anew with it"


def guard_lines(holds: Mapping[str, Sequence[float]]) -> list[str]:
    """Return a guard for offsets by `IN_FORCE`, `G54` and so on, and `G92`; lengths such as `H1` are checked later."""
    checks = []
    for name in (IN_FORCE, *SYSTEMS):
        if name in holds:
            number = f"[{{}}+{PER_SYSTEM}*#{SYSTEM}]" if name == IN_FORCE else "{}"
            first = FIRST_PARAMETERS.get(name, _IN_FORCE)
            parameters = [f"#{number.format(first + k)}" for k in range(_AXES + 1)]
            checks.append((parameters, holds[name], _WORK.format(name, offset_text(holds[name]))))
    g92 = holds.get("G92", ZERO)
    parameters = [f"#{FIRST_PARAMETERS['G92'] + k}" for k in range(_AXES)]
    checks.append((parameters, g92, _OTHER.format(offset_text(g92))))
    if not any(name.startswith("H") for name in holds):
        checks.append((["#<_tool_offset>"], (), _TOOL))
    return list(_stops(checks, FIRST_LABEL))


def length_lines(tool: str, length: Sequence[float], row: int) -> Iterator[str]:
    """Yield the guard for a tool length, `H1`, that a row of the toolpath activates."""
    parameters = [f"#{LENGTH + k}" for k in range(_AXES)]
    check = parameters, length, _LENGTHS.format(tool[1:], offset_text(length))
    yield from _stops([check], FIRST_LENGTH_LABEL + 2 * row)


def _stops(checks: Sequence[tuple[Sequence[str], Sequence[float], str]], label: int) -> Iterator[str]:
    for parameters, expected, message in checks:
        wanted = [*expected, *(0.0 for _ in parameters[len(expected) :])]
        off = [f"ABS[{one}{f'-[{value:.6f}]' if value else ''}]" for one, value in zip(parameters, wanted, strict=True)]
        for place in range(0, len(off), _TERMS):
            condition = "+".join(off[place : place + _TERMS])
            yield from (
                f"o{label} if [[{condition}] GT {WITHIN:g}]",
                f"({MESSAGE}{message})",
                "M0",
                "M02",
                f"o{label} endif",
            )
            label += 1
