"""Place labels without overlap, in inches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

STEP_IN = 0.05
"""Distance between successive trial positions of a label [inch]."""

_AROUND = np.radians(np.arange(0.0, 360.0, 22.5))


@dataclass(frozen=True)
class Box:
    """A rectangle [inch]."""

    left: float
    bottom: float
    width: float
    height: float

    def meets(self, other: Box) -> bool:
        """Return whether both overlap; touching edges do not count."""
        return (
            self.left < other.left + other.width
            and other.left < self.left + self.width
            and self.bottom < other.bottom + other.height
            and other.bottom < self.bottom + self.height
        )

    def holds(self, other: Box) -> bool:
        """Return whether the other box is inside this one."""
        return (
            self.left <= other.left
            and self.bottom <= other.bottom
            and other.left + other.width <= self.left + self.width
            and other.bottom + other.height <= self.bottom + self.height
        )


def place_labels(
    anchors: Sequence[tuple[float, float]],
    sizes: Sequence[tuple[float, float]],
    within: Box,
    keep_off: Sequence[Box] = (),
) -> list[Box | None]:
    """Return each label's box [inch], as near to its anchor as possible; None without room."""
    taken = list(keep_off)
    placed: list[Box | None] = []
    for anchor, size in zip(anchors, sizes, strict=True):
        free = next((box for box in _tried(anchor, size, within) if not any(map(box.meets, taken))), None)
        placed.append(free)
        if free is not None:
            taken.append(free)
    return placed


def _tried(anchor: tuple[float, float], size: tuple[float, float], within: Box) -> list[Box]:
    width, height = size
    steps = int(np.hypot(within.width, within.height) / STEP_IN) + 1
    boxes = (
        Box(
            anchor[0] + (0.5 * width + away) * float(np.cos(angle)) - 0.5 * width,
            anchor[1] + (0.5 * height + away) * float(np.sin(angle)) - 0.5 * height,
            width,
            height,
        )
        for away in STEP_IN * np.arange(1, steps + 1)
        for angle in _AROUND
    )
    return [box for box in boxes if within.holds(box)]
