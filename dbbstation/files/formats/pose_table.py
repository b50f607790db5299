"""Read and write CSV tables of poses, `x_mm,y_mm,z_mm,a_deg,b_deg,c_deg`; further columns are kept."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import MOST_FAULTS, Faults, InputError, refuse
from dbbstation.files.csv_rows import csv_rows, csv_text
from dbbstation.files.formats.number_language import DECIMALS, PLAIN, SEPARATORS, NumberLanguage
from dbbstation.files.provenance import Provenance, write_table
from dbbstation.files.source_text import LARGEST_TABLE, shortened, text_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from dbbstation.computing.arrays import Floats

POSE_COLUMNS = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
UNCERTAINTY_COLUMNS = ("u_x_mm", "u_y_mm", "u_z_mm")
REASON_COLUMN = "u_not_known_because"
"""Column with the reason for empty uncertainties; its cell is empty if all three are known."""
WARNING_COLUMN = "model_warning"
"""Column with an objection to the model, the same in all rows; absent without one."""
ELSE = "other tables need --decimal and --separator, or `numbers` in the settings"


@dataclass(frozen=True, eq=False)
class PoseTable:
    """Poses of a file.

    Attributes:
        poses: shape (n, 6) [mm, deg].
        others: texts of further columns by name.
    """

    poses: Floats
    others: dict[str, list[str]]


def read_poses(path: Path, language: NumberLanguage = PLAIN) -> PoseTable:
    """Read a table of poses.

    Raises:
        InputError: every missing column and every cell that is no finite number, with its line.
    """
    text = text_of(path, LARGEST_TABLE)
    table = csv_rows(io.StringIO(text, newline=""), language.separator, str(path), skip_spaces=True)
    _, names = next(table, (1, []))
    missing = [name for name in POSE_COLUMNS if name not in names]
    if missing:
        remedy = f"the first line must name {', '.join(POSE_COLUMNS)}"
        if any(sign in name for name in names for sign in SEPARATORS if sign != language.separator):
            remedy += f"; {language.text}: {ELSE}"
        raise InputError.of(path, f"no column {', '.join(missing)}", remedy, line=1, column=1)
    faults = Faults(path)
    rows: list[list[float]] = []
    others: dict[str, list[str]] = {name: [] for name in names if name not in POSE_COLUMNS}
    for line, cells in table:
        if not cells:
            continue
        if len(cells) != len(names):
            what = f"{len(cells)} values in {len(names)} columns"
            remedy = f"compare the line with the header; {language.text}"
            faults.add(what, remedy, line)
            continue
        row = dict(zip(names, cells, strict=True))
        rows.append([_number(row[name], name, line, language, faults) for name in POSE_COLUMNS])
        for name, kept in others.items():
            kept.append(row[name])
    refuse(faults[:MOST_FAULTS])
    if not rows:
        raise InputError.of(path, "no pose follows the header", "give one pose per line", line=1, column=1)
    return PoseTable(np.array(rows), others)


def _number(cell: str, name: str, line: int, language: NumberLanguage, faults: Faults) -> float:
    value = language.number(cell)
    if not np.isfinite(value):
        remedy = f"{language.text}: {ELSE}" if set(cell) & set(DECIMALS) else "correct or remove the line"
        faults.add(f"{name} is {shortened(cell)!r}, not a number", remedy, line)
    return value


def write_poses(
    path: Path,
    poses: Floats,
    uncertainty_mm: Floats,
    others: Mapping[str, Sequence[str]],
    provenance: Provenance,
    *,
    why_unknown: str = "",
    warning: str = "",
    force: bool = False,
) -> None:
    """Write poses with uncertainties and further columns, and a provenance file beside them.

    Args:
        uncertainty_mm: of X, Y and Z, shape (n, 3); NaN, written as an empty cell, if not known.
        warning: objection to the model, or empty.

    Raises:
        OutputError: the file exists without `force`, or cannot be written.
    """
    own = (*UNCERTAINTY_COLUMNS, REASON_COLUMN, *([WARNING_COLUMN] if warning else []))
    kept = {name: cells for name, cells in others.items() if name not in {*own, WARNING_COLUMN}}
    rows: list[list[str]] = [[*POSE_COLUMNS, *own, *kept]]
    for k, (pose, uncertainty) in enumerate(zip(poses, uncertainty_mm, strict=True)):
        numbers = [f"{value:.9f}" for value in pose]
        numbers += ["" if np.isnan(value) else f"{value:.7f}" for value in uncertainty]
        reason = why_unknown if np.isnan(uncertainty).any() else ""
        rows.append([*numbers, reason, *([warning] if warning else []), *(cells[k] for cells in kept.values())])
    write_table(path, csv_text(rows), provenance, force=force)
