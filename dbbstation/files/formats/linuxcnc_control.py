"""LinuxCNC's parameter file and tool table, as far as NC programs depend on them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, TypeVar

from dbbstation.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

Value = TypeVar("Value")

_PARAMETER = re.compile(r"\s*(\d+)\s+([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*")
_TOOL_WORD = re.compile(r"([A-Z])\s*([-+]?\d+(?:\.\d*)?|[-+]?\.\d+)")


def parameters_of(text: str, file: str) -> dict[int, float]:
    """Return the numbered parameters of a LinuxCNC parameter file.

    Raises:
        InputError: a line is no valid entry, or the file has no entries.
    """

    def entry(line: str) -> tuple[int, float] | None:
        match = _PARAMETER.fullmatch(line)
        return None if match is None else (int(match[1]), float(match[2]))

    said = "parameter", "parameter file", "a number and its value", "linuxcnc.var"
    return _entries(text.splitlines(), file, entry, said)


def tools_of(text: str, file: str) -> dict[int, dict[str, float]]:
    """Return each tool's words in a LinuxCNC tool table, by tool number.

    Raises:
        InputError: a line is no valid entry, or the file has no entries.
    """

    def entry(line: str) -> tuple[int, dict[str, float]] | None:
        words = {letter: float(value) for letter, value in _TOOL_WORD.findall(line)}
        return None if "T" not in words or _TOOL_WORD.sub("", line).strip() else (int(words["T"]), words)

    lines = [line.partition(";")[0].upper() for line in text.splitlines()]
    return _entries(lines, file, entry, ("tool", "tool table", "T and words such as Z52.1", "tool.tbl"))


def _entries(
    lines: Sequence[str], file: str, entry: Callable[[str], tuple[int, Value] | None], said: tuple[str, str, str, str]
) -> dict[int, Value]:
    found: dict[int, Value] = {}
    thing, kind, content, example = said
    for number, line in enumerate(lines, 1):
        if line.strip():
            one = entry(line)
            if one is None:
                raise InputError.of(file, f"this is not a line of a {kind}", f"a line needs {content}", number, 1)
            found[one[0]] = one[1]
    if not found:
        raise InputError.of(file, f"no {thing} in it", f"name LinuxCNC's {kind}, such as {example}")
    return found
