"""What a control knows and a program does not say: work offsets, tool lengths, reference points."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dbbstation.errors import InputError, Problem
from dbbstation.nc.toolpath import SYSTEMS

if TYPE_CHECKING:
    from collections.abc import Mapping

FIRST_PARAMETERS = {
    "G28": 5161,
    "G30": 5181,
    "G92": 5211,
    **{name: 5221 + 20 * place for place, name in enumerate(SYSTEMS)},
}
"""First of six numbered parameters of each place [LinuxCNC, G-code overview, Numbered Parameters]."""

ROTATION_BEHIND = 9
"""The rotation of a work system about Z stands so many parameters behind its X."""

G92_IN_FORCE = 5210

ZERO = (0.0,) * 6


@dataclass(frozen=True)
class Setup:
    """What was declared of a control, lengths in mm.

    Attributes:
        places: work offsets, `G92` and the reference points `G28` and `G30`, each shape (6,) [mm, deg].
        lengths: offsets of tools by number, each shape (6,) [mm, deg].
        parameters: all numbered parameters of the control's file; None: not known.
    """

    places: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    lengths: Mapping[int, tuple[float, ...]] = field(default_factory=dict)
    parameters: Mapping[int, float] | None = None

    def place(self, name: str) -> tuple[float, ...] | None:
        """Return a work offset, G92 or a reference point; None if a reference point is not known."""
        if name in self.places:
            return self.places[name]
        if self.parameters is None:
            return None if name in {"G28", "G30"} else ZERO
        if name == "G92" and not self.parameters.get(G92_IN_FORCE, 0.0):
            return ZERO
        first = FIRST_PARAMETERS[name]
        return tuple(self.parameters.get(first + axis, 0.0) for axis in range(6))

    def rotation_deg(self, name: str) -> float:
        """Return by how much a work system is turned about Z."""
        if self.parameters is None or name in self.places:
            return 0.0
        return self.parameters.get(FIRST_PARAMETERS[name] + ROTATION_BEHIND, 0.0)


_PARAMETER = re.compile(r"\s*(\d+)\s+([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*")
_TOOL_WORD = re.compile(r"([A-Z])\s*([-+]?\d+(?:\.\d*)?|[-+]?\.\d+)")


def parameters_of(text: str, file: str) -> dict[int, float]:
    """Return the numbered parameters of a LinuxCNC parameter file.

    Raises:
        InputError: a line that is none, or none at all.
    """
    found: dict[int, float] = {}
    for number, line in enumerate(text.splitlines(), 1):
        match = _PARAMETER.fullmatch(line)
        if match is None and line.strip():
            raise InputError(
                [Problem(file, number, 1, "no line of a parameter file", "it needs a number and its value")]
            )
        if match is not None:
            found[int(match[1])] = float(match[2])
    if not found:
        raise InputError(
            [Problem(file, 0, 0, "no parameter in it", "name LinuxCNC's parameter file, such as linuxcnc.var")]
        )
    return found


def lengths_of(text: str, file: str) -> dict[int, tuple[float, ...]]:
    """Return the offsets of tools by number of a LinuxCNC tool table.

    Raises:
        InputError: a line that is none, or none at all.
    """
    found: dict[int, tuple[float, ...]] = {}
    for number, line in enumerate(text.splitlines(), 1):
        said = line.partition(";")[0].upper()
        words = {letter: float(value) for letter, value in _TOOL_WORD.findall(said)}
        if not said.strip():
            continue
        if "T" not in words or _TOOL_WORD.sub("", said).strip():
            raise InputError(
                [Problem(file, number, 1, "no line of a tool table", "it needs T and words such as Z52.1")]
            )
        found[int(words["T"])] = tuple(words.get(axis, 0.0) for axis in "XYZABC")
    if not found:
        raise InputError([Problem(file, 0, 0, "no tool in it", "name LinuxCNC's tool table, such as tool.tbl")])
    return found
