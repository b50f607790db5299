"""Poses as a table for an external postprocessor: machine coordinates and F of each move."""

from __future__ import annotations

import csv
import math
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import Faults, refuse
from dbbstation.nc.dialect import Dialect, plain
from dbbstation.nc.toolpath import RowKind, Toolpath, ToolpathBuilder, rounded
from dbbstation.nc.words import CannotSayError, digits

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats

COLUMNS = "x_mm,y_mm,z_mm,a_deg,b_deg,c_deg,feed"
"""F is the feed of the tip [mm/min], or of the angles if only they move [deg/min]; empty in rapids."""


class Poses(Dialect):
    """A row for each move. The postprocessor adds dwells, stops, tools and spindle."""

    name = "poses"
    extension = ".csv"
    what = "poses as a CSV table, for a postprocessor of your own"

    def write(self, toolpath: Toolpath, header: Sequence[str] = ()) -> str:
        """Return the table, the header as lines that begin with #.

        Raises:
            CannotSayError: a row that is no move.
        """
        told = ~toolpath.is_move & (toolpath.kind != RowKind.COMMENT)
        if told.any():
            row = int(np.argmax(told))
            what = f"{RowKind(toolpath.kind[row]).name.lower().replace('_', ' ')} {toolpath.text.get(row, '')}".rstrip()
            raise CannotSayError(self.name, what, where=toolpath.where(row))
        lines = [*(f"# {plain(text)}" for text in header), COLUMNS]
        moves = toolpath.is_move
        form = ",".join(f"%.{decimals}f" for decimals in self.decimals)
        for pose, feed in zip(
            rounded(toolpath.poses[moves], self.decimals).tolist(), toolpath.feed[moves].tolist(), strict=True
        ):
            lines.append(f"{form % tuple(pose)},{'' if math.isnan(feed) else digits(feed)}")
        return "\n".join(lines) + "\n"

    def read(self, text: str, name: str, *, start: Floats | None = None) -> Toolpath:  # type: ignore[override]  # takes no setup
        """Return the moves of a table."""
        path, faults, named = ToolpathBuilder(name, start), Faults(name), False
        for line, row in enumerate(csv.reader(text.splitlines()), 1):
            if row and row[0].startswith("#"):
                path.say(RowKind.COMMENT, ",".join(row).removeprefix("# "), line=line)
            elif not named and row:
                named = True
                if ",".join(each.strip() for each in row) != COLUMNS:
                    faults.add("the columns are others", f"name them {COLUMNS}", line, 1)
            elif row:
                self._move(path, row, line, faults)
        refuse(faults[:20])
        return path.built()

    @staticmethod
    def _move(path: ToolpathBuilder, row: list[str], line: int, faults: Faults) -> None:
        try:
            pose, feed = np.array([float(each) for each in row[:6]]), float(row[6]) if row[6].strip() else 0.0
        except (ValueError, IndexError):
            pose, feed = np.full(6, np.nan), -1.0
        if len(row) != len(COLUMNS.split(",")) or not np.isfinite([*pose, feed]).all() or feed < 0.0:
            faults.add("no pose and feed", "give seven numbers, the feed empty in rapids", line, 1)
        elif feed > 0.0:
            path.feed(pose[None], feed, line=line)
        else:
            path.rapid(pose, line=line)
