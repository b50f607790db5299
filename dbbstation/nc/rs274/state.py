"""Position and coordinates of a control: pose, work offsets, G92, tool lengths, and their parameters."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.nc.rs274.blocks import ModalGroup, name
from dbbstation.nc.setup import FIRST_PARAMETERS, ZERO
from dbbstation.nc.toolpath import SYSTEMS
from dbbstation.nc.words import digits

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dbbstation.computing.arrays import Floats
    from dbbstation.nc.rs274.blocks import ProgramBlock
    from dbbstation.nc.rs274.tokens import BadLine, Word
    from dbbstation.nc.setup import ControlSetup

AXES, CENTRES = "XYZABC", "IJK"

POSITION, SYSTEM, TOOL, LENGTH = 5420, 5220, 5400, 5401


class ModalCycle:
    """State of drilling cycles between lines.

    Attributes:
        numbers: Z, R and Q [mm] and P [s].
        begun_at: Z before the first of successive cycles, in machine coordinates [mm]; NaN if not known.
        dwell_s: P of the last cycle that had one: a tapping cycle without P has it [LinuxCNC].
        to_clear: whether they end at R (G99); None: neither G98 nor G99 was read.
    """

    def __init__(self) -> None:
        self.numbers: dict[str, float] = {}
        self.begun_at, self.dwell_s = math.nan, 0.0
        self.to_clear: bool | None = None


class ControlState:
    """Pose in machine coordinates, and the offsets that are added to programmed numbers.

    Attributes:
        system: number of the work system, from 1.
        g92: in force, shape (6,) [mm, deg].
        length: of the tool in force, shape (6,) [mm, deg].
        length_said: whether a tool length is in force.
        tool: in the spindle; None if not known.
    """

    def __init__(self, setup: ControlSetup, pose: Floats) -> None:
        self.setup, self.pose, self.unit_mm, self.system = setup, pose, 1.0, 1
        self.lengths, self.diameters = dict(setup.lengths), dict(setup.diameters)
        self.tools_set: set[int] = set()
        self._systems: dict[int, tuple[float, ...]] = {}
        self.g92 = setup.place("G92") or ZERO
        self._suspended = self.g92
        self.length: tuple[float, ...] = ZERO
        self.length_said = False
        self.tool: int | None = None
        self.tool_selected: int | None = None
        self._counted()

    def _counted(self) -> None:
        parts = zip(self.offset_of(self.system), self.g92, self.length, strict=True)
        self.offset = tuple(sum(part) for part in parts)

    def offset_of(self, system: int) -> tuple[float, ...]:
        """Return the offset of a work system, shape (6,) [mm, deg]."""
        return self._systems.get(system) or self.setup.place(SYSTEMS[system - 1]) or ZERO

    def use_system(self, system: str, block: ProgramBlock) -> None:
        """Use a work system for the following numbers."""
        turned = self.setup.rotation_deg(system)
        if turned:
            what = f"{system} is turned by {turned:g} degrees about Z in the parameter file"
            raise block.fault(what, "set its rotation to zero (G10 L2 R0)", block.codes[ModalGroup.OFFSET])
        self.system = SYSTEMS.index(system) + 1
        self._counted()

    def set_system(self, block: ProgramBlock) -> tuple[str, str, tuple[float, ...]]:
        """Run G10 L2 or L20. Return the equivalent G10 L2, the system and its former offset."""
        word = block.codes[ModalGroup.ONCE]
        if block.words.get("L", word).value == 1.0:
            return self._set_tool(block), "", ()
        kind, which, turned = (block.take(letter) for letter in "LPR")
        if kind is None or kind.value not in {2.0, 20.0} or which is None or which.value not in range(10):
            said = "" if kind is None else f" L{kind.value:g}"
            raise block.fault(f"G10{said} is not read", "G10 L1, L2 and L20 with P0 to P9 are", word)
        if turned is not None and turned.value != 0.0:
            raise block.fault("G10 with a rotation (R)", "post the program without rotation", turned)
        system = int(which.value) or self.system
        before, offset = self.offset_of(system), list(self.offset_of(system))
        for axis, value in self._taken(block):
            beside = self.g92[axis] + self.length[axis]
            offset[axis] = value if kind.value == 2.0 else self._known(axis, block, word) - beside - value  # noqa: PLR2004
        self._systems[system] = tuple(offset)
        self._counted()
        words = " ".join(f"{letter}{digits(value)}" for letter, value in zip(AXES, offset, strict=True))
        return f"G10 L2 P{system} {words}", SYSTEMS[system - 1], before

    def _set_tool(self, block: ProgramBlock) -> str:
        word, which, radius = block.words.pop("L"), block.take("P"), block.take("R")
        if which is None or not which.counts(1.0):
            raise block.fault("G10 L1 without the number of a tool", "give P, a whole number from 1", word)
        tool, said = int(which.value), f"G10 L1 P{which.value:g}"
        length = list(self.lengths.get(tool, ZERO))
        for axis, value in self._taken(block):
            length[axis], said = value, f"{said} {AXES[axis]}{digits(value)}"
        self.lengths[tool] = tuple(length)
        if radius is not None:
            self.diameters[tool], said = (
                2.0 * radius.value * self.unit_mm,
                f"{said} R{digits(radius.value * self.unit_mm)}",
            )
        self.tools_set.add(tool)
        return said

    def shift(self, code: float, block: ProgramBlock) -> None:
        """Run G52 or G92 to G92.3."""
        word, shift = block.codes[ModalGroup.ONCE], list(self.g92)
        if code in {52.0, 92.0} and block.words.keys().isdisjoint(AXES):
            raise block.fault(f"{name('G', code)} without axes", "give the axes that it sets", word)
        for axis, value in self._taken(block) if code in {52.0, 92.0} else ():
            beside = self.offset_of(self.system)[axis] + self.length[axis]
            shift[axis] = value if code == 52.0 else self._known(axis, block, word) - beside - value  # noqa: PLR2004
        if code in {92.1, 92.2}:
            self._suspended = self.g92 if code == 92.2 else ZERO  # noqa: PLR2004
            self.g92 = ZERO
        else:
            self.g92 = self._suspended if code == 92.3 else tuple(shift)  # noqa: PLR2004
        self._counted()

    def use_length(self, tool: Word | None, block: ProgramBlock, code: Word) -> int:
        """Use the length of a tool, or zero for G49; return the tool's number."""
        if code.value == 49.0:  # noqa: PLR2004
            self.length, self.length_said = ZERO, False
            self._counted()
            return 0
        which, at = (self.tool, code) if tool is None else (tool.value, tool)
        if which is None or which < 1.0 or which != int(which):
            what = f"{name('G', code.value)} without the number of a tool" if tool is None else f"H{which:g} is no tool"
            raise block.fault(what, "give H, a whole number from 1", at)
        if int(which) not in self.lengths:
            what = f"the length of tool {which:g} is not known"
            remedy = f"give it with --tool-lengths-mm {which:g}=MM, or LinuxCNC's tool table with --tools"
            raise block.fault(what, remedy, at)
        self.length, self.length_said = self.lengths[int(which)], True
        self._counted()
        return int(which)

    def parameter(self, which: int | str) -> float | None:
        """Return a parameter of the control; None if unknown."""
        if isinstance(which, str):
            return self._named(which)
        if POSITION <= which < POSITION + 6:
            return self._position(which - POSITION)
        for first, values in self._rows():
            if first <= which < first + len(values):
                return values[which - first]
        return None if self.setup.parameters is None else self.setup.parameters.get(which, 0.0)

    def _rows(self) -> list[tuple[int, tuple[float, ...]]]:
        """Return the values of successive parameters. U, V, W and the rotation are zero."""
        rows = [(FIRST_PARAMETERS[each], self.offset_of(number)) for number, each in enumerate(SYSTEMS, 1)]
        rows += [(FIRST_PARAMETERS["G92"], self.g92), (LENGTH, self.length)]
        known = ((FIRST_PARAMETERS[each], self.setup.place(each)) for each in ("G28", "G30"))
        rows += [(first, values) for first, values in known if values is not None]
        rows = [(first, (*values, *ZERO[:4])) for first, values in rows]
        tool = [] if self.tool is None else [(TOOL, (float(self.tool),))]
        return [(SYSTEM, (float(self.system),)), *tool, *rows]

    def _named(self, which: str) -> float | None:
        if len(which) == 2 and which[0] == "_" and which[1].upper() in AXES:  # noqa: PLR2004 - _x
            return self._position(AXES.index(which[1].upper()))
        known = {
            "_tool_offset": float(self.length_said),
            "_metric": float(self.unit_mm == 1.0),
            "_imperial": float(self.unit_mm != 1.0),
            "_coord_system": 530.0 + 10.0 * self.system if self.system < 7 else 584.0 + self.system,  # noqa: PLR2004
            "_current_tool": None if self.tool is None else float(self.tool),
            "_selected_tool": None if self.tool_selected is None else float(self.tool_selected),
        }
        return known.get(which)

    def _position(self, axis: int) -> float | None:
        place = float(self.pose[axis]) - self.offset[axis]
        return None if np.isnan(place) else place / (self.unit_mm if axis < 3 else 1.0)  # noqa: PLR2004

    def _taken(self, block: ProgramBlock) -> list[tuple[int, float]]:
        words = [(axis, block.take(letter)) for axis, letter in enumerate(AXES)]
        return [(axis, word.value * (self.unit_mm if axis < 3 else 1.0)) for axis, word in words if word]  # noqa: PLR2004

    def _known(self, axis: int, block: ProgramBlock, word: Word) -> float:
        if np.isnan(self.pose[axis]):
            what = (
                f"{name('G', word.value)} counts from the place of {AXES[axis]}, which the program does not state yet"
            )
            raise block.fault(what, f"move {AXES[axis]} to a known position first, or give --start", word)
        return float(self.pose[axis])


def unplaced(pose: Iterable[float]) -> list[str]:
    """Return the axes that are NaN in a pose, shape (6,)."""
    return [letter for letter, at in zip(AXES, pose, strict=True) if math.isnan(at)]


def unknown_place(block: ProgramBlock, axes: list[str], when: str = " before this move") -> BadLine:
    """Return the fault of a block that needs the unknown position of axes."""
    what = f"the program does not state the place of {', '.join(axes)}{when}"
    remedy = (
        "--angles-deg A,B,C states at which a program without them runs"
        if set(axes) <= set("ABC")
        else "name all axes in rapids before the first cut, absolutely (G90), or say with --start where the machine stands"
    )
    return block.fault(what, remedy)
