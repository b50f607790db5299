"""Read and write CSV tables of poses, `x_mm,y_mm,z_mm,a_deg,b_deg,c_deg`; further columns are kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import MOST_FAULTS, refuse
from dbbstation.files.csv_rows import csv_text
from dbbstation.files.formats.number_language import PLAIN, NumberLanguage
from dbbstation.files.provenance import Provenance, write_table
from dbbstation.files.recordings.table_csv import read_table

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from dbbstation.computing.arrays import Floats
    from dbbstation.files.recordings.table_csv import TableFile

POSE_COLUMNS = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
UNCERTAINTY_COLUMNS = ("u_x_mm", "u_y_mm", "u_z_mm")
REASON_COLUMN = "u_not_known_because"
"""Column with the reason for empty uncertainties; its cell is empty if all three are known."""
WARNING_COLUMN = "model_warning"
"""Column with an objection to the model, the same in all rows; absent without one."""


@dataclass(frozen=True, eq=False)
class PoseTable:
    """Poses of a file.

    Attributes:
        poses: shape (n, 6) [mm, deg].
        others: texts of further columns by name.
    """

    poses: Floats
    others: Mapping[str, Sequence[str]]


def read_poses(path: Path, language: NumberLanguage = PLAIN) -> PoseTable:
    """Read a table of poses.

    Raises:
        InputError: every missing column and every cell that is no finite number, with its line.
    """
    table = read_table(path, POSE_COLUMNS, language)
    other = "other tables need --decimal and --separator, or `numbers` in the settings"
    remedy = f"correct or remove the line; {language.text}: {other}"
    refuse([fault for name in POSE_COLUMNS for fault in table.not_finite(name, remedy)][:MOST_FAULTS])
    return poses_of(table)


def poses_of(table: TableFile) -> PoseTable:
    """Return the poses of a table that has their columns."""
    others = {name: table.cells[name] for name in table.names if name not in POSE_COLUMNS}
    return PoseTable(np.column_stack([table.values[name] for name in POSE_COLUMNS]), others)


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
