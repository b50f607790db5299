"""LinuxCNC's parameter file and tool table, as far as NC programs depend on them."""

from __future__ import annotations

import re

from dbbstation.errors import InputError

_PARAMETER = re.compile(r"\s*(\d+)\s+([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*")
_TOOL_WORD = re.compile(r"([A-Z])\s*([-+]?\d+(?:\.\d*)?|[-+]?\.\d+)")


def parameters_of(text: str, file: str) -> dict[int, float]:
    """Return the numbered parameters of a LinuxCNC parameter file.

    Raises:
        InputError: a line is no valid entry, or the file has no entries.
    """
    found: dict[int, float] = {}
    for number, line in enumerate(text.splitlines(), 1):
        match = _PARAMETER.fullmatch(line)
        if match is None and line.strip():
            raise InputError.of(
                file,
                "this is not a line of a parameter file",
                "a line needs a number and its value",
                line=number,
                column=1,
            )
        if match is not None:
            found[int(match[1])] = float(match[2])
    if not found:
        raise InputError.of(file, "no parameter in it", "name LinuxCNC's parameter file, such as linuxcnc.var")
    return found


def tools_of(text: str, file: str) -> dict[int, dict[str, float]]:
    """Return each tool's words in a LinuxCNC tool table, by tool number.

    Raises:
        InputError: a line is no valid entry, or the file has no entries.
    """
    found: dict[int, dict[str, float]] = {}
    for number, line in enumerate(text.splitlines(), 1):
        said = line.partition(";")[0].upper()
        words = {letter: float(value) for letter, value in _TOOL_WORD.findall(said)}
        if not said.strip():
            continue
        if "T" not in words or _TOOL_WORD.sub("", said).strip():
            raise InputError.of(
                file,
                "this is not a line of a tool table",
                "a line needs T and words such as Z52.1",
                line=number,
                column=1,
            )
        found[int(words["T"])] = words
    if not found:
        raise InputError.of(file, "no tool in it", "name LinuxCNC's tool table, such as tool.tbl")
    return found
