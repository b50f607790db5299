"""State of a control outside the program: work offsets, tool lengths, reference points."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dbbstation.nc.toolpath import SYSTEMS

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

PER_SYSTEM = 20
"""Number of parameters of a work system."""

FIRST_PARAMETERS = {
    "G28": 5161,
    "G30": 5181,
    "G92": 5211,
    **{name: 5221 + PER_SYSTEM * place for place, name in enumerate(SYSTEMS)},
}
"""First of six numbered parameters of each place [LinuxCNC, G-code overview, Numbered Parameters]."""

ROTATION_BEHIND = 9
"""Number of parameters from a work system's X to its rotation about Z."""

G92_IN_FORCE = 5210

ZERO = (0.0,) * 6


def offset_text(offset: Sequence[float]) -> str:
    """Return the words of an offset's nonzero values; offset of shape (6,) [mm, deg]."""
    words = " ".join(f"{axis}{value:g}" for axis, value in zip("XYZABC", offset, strict=True) if value)
    return words or "zero"


@dataclass(frozen=True)
class ControlSetup:
    """Declared state of a control, lengths in mm.

    Attributes:
        places: work offsets, `G92` and the reference points `G28` and `G30`, each shape (6,) [mm, deg].
        lengths: offsets of tools by number, each shape (6,) [mm, deg].
        diameters: of tools by number [mm].
        parameters: all numbered parameters of the control's file; None: unknown.
        subprogram: returns path and text of the file of a subprogram by its name in small letters; None if there is none.
        block_delete: whether the control skips lines that begin with a slash; None: unknown.
    """

    places: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    lengths: Mapping[int, tuple[float, ...]] = field(default_factory=dict)
    diameters: Mapping[int, float] = field(default_factory=dict)
    parameters: Mapping[int, float] | None = field(default=None, kw_only=True)
    subprogram: Callable[[str], tuple[str, str] | None] = field(default=lambda _name: None, kw_only=True)
    block_delete: bool | None = field(default=None, kw_only=True)

    def place(self, name: str) -> tuple[float, ...] | None:
        """Return a work offset, G92 or a reference point; None if unknown."""
        if name in self.places:
            return self.places[name]
        if self.parameters is None:
            return None if name in {"G28", "G30"} else ZERO
        if name == "G92" and not self.parameters.get(G92_IN_FORCE, 0.0):
            return ZERO
        first = FIRST_PARAMETERS[name]
        return tuple(self.parameters.get(first + axis, 0.0) for axis in range(6))

    def rotation_deg(self, name: str) -> float:
        """Return a work system's rotation about Z."""
        if self.parameters is None or name in self.places:
            return 0.0
        return self.parameters.get(FIRST_PARAMETERS[name] + ROTATION_BEHIND, 0.0)
