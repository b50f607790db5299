"""A sheet with one figure; positions are in inches from the lower left."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.textpath import text_to_path

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from dbbstation.report.drawing import LineStyle

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


MARGIN_IN = 0.3
TITLE_PT, NAME_PT, TEXT_PT = 11.0, 6.0, 8.0
"""Sizes of the sheet's title, of the names of the title block's cells, and of all other text [pt]."""

POINTS_PER_INCH = 72.0
_LINE = 1.3
"""Ratio of a line's height to the size of its letters."""

MOST_LINES = 3
"""Greatest number of lines of a cell in the title block; longer text ends in an ellipsis."""

_PAD_IN = 0.05
_KEY_IN = 0.35
_GAP_IN = 0.25


@dataclass(frozen=True)
class Cell:
    """One cell of a title block."""

    name: str
    value: str
    share: float = 1.0


@dataclass(frozen=True, eq=False)
class Key:
    """One entry of a legend."""

    text: str
    style: LineStyle


class Sheet:
    """A sheet that grows with its content."""

    def __init__(
        self, width_in: float, room_in: float, title: str, keys: Sequence[Key], block: Sequence[Sequence[Cell]]
    ) -> None:
        """Lay out the sheet without its panels."""
        self.width_in = width_in
        self.inner_in = width_in - 2.0 * MARGIN_IN
        lines = wrapped(title, TITLE_PT, self.inner_in, MOST_LINES)
        legend = _rows(keys, self.inner_in)
        heading = len(lines) * line_in(TITLE_PT) + len(legend) * 1.3 * line_in(TEXT_PT) + 0.1
        cells = [_cells(row, self.inner_in) for row in block]
        below = sum(height for height, _ in cells)
        self.bottom_in = MARGIN_IN + below + 0.2
        self.top_in = self.bottom_in + room_in
        self.height_in = self.top_in + heading + MARGIN_IN
        self.figure = Figure(figsize=(width_in, self.height_in))
        self._head(lines, legend)
        self._block(cells)

    def axes(self, box: Box) -> Axes:
        """Return new axes in a box of the sheet."""
        across, up = self.width_in, self.height_in
        return self.figure.add_axes((box.left / across, box.bottom / up, box.width / across, box.height / up))

    def text(
        self, x_in: float, y_in: float, text: str, size_pt: float = TEXT_PT, va: str = "top", color: str = "black"
    ) -> None:
        """Write text literally, dollar signs included."""
        place = x_in / self.width_in, y_in / self.height_in
        self.figure.text(*place, text, fontsize=size_pt, va=va, color=color, parse_math=False)

    def _head(self, lines: Sequence[str], legend: Sequence[Sequence[tuple[float, Key]]]) -> None:
        y = self.height_in - MARGIN_IN
        for line in lines:
            self.text(MARGIN_IN, y, line, TITLE_PT)
            y -= line_in(TITLE_PT)
        for row in legend:
            y -= 1.3 * line_in(TEXT_PT)
            for x, key in row:
                ends = (0.0, _KEY_IN) if key.style["linewidth"] else (0.5 * _KEY_IN,)  # a marker stands alone
                middle = (y + 0.45 * line_in(TEXT_PT)) / self.height_in
                across = [(MARGIN_IN + x + end) / self.width_in for end in ends]
                self.figure.add_artist(Line2D(across, [middle] * len(ends), **key.style))
                self.text(MARGIN_IN + x + _KEY_IN + 0.06, y + 0.45 * line_in(TEXT_PT), key.text, va="center")

    def _block(self, rows: Sequence[tuple[float, list[tuple[float, float, str, list[str]]]]]) -> None:
        y = MARGIN_IN + sum(height for height, _ in rows)
        for height, cells in rows:
            y -= height
            for x, width, name, lines in cells:
                corner = (MARGIN_IN + x) / self.width_in, y / self.height_in
                size = width / self.width_in, height / self.height_in
                self.figure.add_artist(Rectangle(corner, *size, fill=False, linewidth=0.5, edgecolor="#555555"))
                left, top = MARGIN_IN + x + _PAD_IN, y + height - _PAD_IN
                self.text(left, top, name, NAME_PT, color="#555555")
                for k, line in enumerate(lines):
                    self.text(left, top - line_in(NAME_PT) - k * line_in(TEXT_PT), line)


def line_in(size_pt: float) -> float:
    """Return a line's height [inch]."""
    return _LINE * size_pt / POINTS_PER_INCH


def width_of_in(text: str, size_pt: float) -> float:
    """Return a text's width [inch]."""
    width, _, _ = text_to_path.get_text_width_height_descent(text, FontProperties(size=size_pt), ismath=False)
    return float(width) / POINTS_PER_INCH


def wrapped(text: str, size_pt: float, width_in: float, most: int) -> list[str]:
    """Return a text in lines; an ellipsis replaces what does not fit."""
    rest, lines = " ".join(text.split()), list[str]()
    while rest and len(lines) < most:
        end = _fitting(rest, size_pt, width_in)
        if end < len(rest) and len(lines) < most - 1:
            end = max(rest.rfind(" ", 1, end + 1), 0) or end
        elif end < len(rest):
            lines.append(rest[: max(_fitting(rest, size_pt, width_in - width_of_in("…", size_pt)), 1)].rstrip() + "…")
            break
        lines.append(rest[:end])
        rest = rest[end:].lstrip()
    return lines or [""]


def _fitting(text: str, size_pt: float, width_in: float) -> int:
    low, high = 1, len(text)
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if width_of_in(text[:middle], size_pt) <= width_in else (low, middle - 1)
    return low


def _rows(keys: Sequence[Key], width_in: float) -> list[list[tuple[float, Key]]]:
    rows: list[list[tuple[float, Key]]] = []
    x = 0.0
    for key in keys:
        text = wrapped(key.text, TEXT_PT, width_in - _KEY_IN - 0.1, 1)[0]
        needed = _KEY_IN + 0.06 + width_of_in(text, TEXT_PT)
        if not rows or x + needed > width_in:
            rows.append([])
            x = 0.0
        rows[-1].append((x, Key(text, key.style)))
        x += needed + _GAP_IN
    return rows


def _cells(row: Sequence[Cell], width_in: float) -> tuple[float, list[tuple[float, float, str, list[str]]]]:
    whole = sum(cell.share for cell in row)
    x, cells = 0.0, list[tuple[float, float, str, list[str]]]()
    for cell in row:
        width = width_in * cell.share / whole
        cells.append((x, width, cell.name, wrapped(cell.value, TEXT_PT, width - 2.0 * _PAD_IN, MOST_LINES)))
        x += width
    most = max(len(lines) for _, _, _, lines in cells)
    return 2.0 * _PAD_IN + line_in(NAME_PT) + most * line_in(TEXT_PT), cells
