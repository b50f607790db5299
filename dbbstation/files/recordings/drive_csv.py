"""Read recordings of a drive: CSV with `t_s,position_mm` and `force_n` or `motor_current_a`; `#` begins a comment."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import Faults, InputError, Problem, refuse
from dbbstation.files.formats.number_language import PLAIN
from dbbstation.files.recordings.run_csv import Counted, check_numbers
from dbbstation.files.recordings.table_csv import given_table, missing_column, parse_table
from dbbstation.files.source_text import LARGEST_TABLE, first_line, numbered_lines, text_of
from dbbstation.trace.drive import DriveRecording

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from dbbstation.computing.arrays import Floats
    from dbbstation.files.recordings.table_csv import Columns, TableFile

TIME, POSITION, FORCE, CURRENT = "t_s", "position_mm", "force_n", "motor_current_a"
REQUIRED = (TIME, POSITION)

LARGEST = {TIME: (1e6, "s"), POSITION: (1e5, "mm"), FORCE: (1e7, "N"), CURRENT: (1e4, "A")}
"""Greatest plausible size of each column, and its unit."""


@dataclass(frozen=True, eq=False)
class DriveFile:
    """A drive's recording file.

    Attributes:
        numbers: known columns by name, each of shape (n,), in the unit of the name.
        warnings: findings that do not invalidate it.
    """

    file: str
    line: int
    numbers: dict[str, Floats]
    warnings: tuple[Problem, ...]

    def recording(self, force_per_ampere_n: float | None = None) -> DriveRecording:
        """Return the recording. The force is a column, or the current times a factor.

        Args:
            force_per_ampere_n: force at 1 A, positive towards greater positions [N/A].

        Raises:
            InputError: neither force nor factor is given.
        """
        force = self.numbers.get(FORCE)
        if force is None or (force_per_ampere_n is not None and CURRENT in self.numbers):
            if force_per_ampere_n is None or CURRENT not in self.numbers:
                what = f"there is `{CURRENT}` and no `{FORCE}`" if force is None else f"there is no `{CURRENT}`"
                remedy = "say with --force-per-ampere how many newtons an ampere is: 2 pi torque constant / lead"
                raise InputError.of(self.file, what, remedy if force is None else "", line=self.line)
            force = force_per_ampere_n * self.numbers[CURRENT]
        return DriveRecording(self.file, self.numbers[TIME], self.numbers[POSITION], force)


def looks_like_drive(path: Path) -> bool:
    """Return whether the header has a position and no bar length."""
    try:
        head = first_line(path)
    except OSError:
        return False
    names = {name.strip() for name in head.decode("utf-8-sig", "replace").split(",")}
    return POSITION in names and "length_mm" not in names


def read_drive(path: Path) -> DriveFile:
    """Read a recording of a drive.

    Raises:
        InputError: every missing column and unusable line.
    """
    return parse_drive(text_of(path, LARGEST_TABLE), str(path))


def given_drive(given: Columns, name: str) -> DriveFile:
    """Return columns in memory as a recording of a drive.

    Raises:
        InputError: missing columns, columns of several lengths, or unusable values.
    """
    return _checked(given_table(given, (), name), Faults(name))


def parse_drive(text: str, file: str) -> DriveFile:
    """Parse the text of a recording.

    Raises:
        InputError: as `read_drive`.
    """
    lines = numbered_lines(text)
    if not lines:
        what, remedy = "there is no line that names the columns", f"begin with `{TIME},{POSITION},{FORCE}`"
        raise InputError.of(file, what, remedy)
    warnings = Faults(file)
    number, last = lines[-1]
    if not text.endswith("\n") and last.count(",") != lines[0][1].count(","):
        warnings.add("the last line was cut off; it is left out", line=number)
        text = text[: text.rindex(last)]
    return _checked(parse_table(text, file, numbers=PLAIN), warnings)


def _checked(table: TableFile, warnings: Faults) -> DriveFile:
    file, header, names = table.file, table.header, list(table.names)
    faults = Counted(file)
    faults += [missing_column(name, names, file, header) for name in REQUIRED if name not in names]
    if FORCE not in names and CURRENT not in names:
        faults.add(f"neither `{FORCE}` nor `{CURRENT}` is there", f"columns here: {', '.join(names)}", header)
    numbers = {name: table.values[name] for name in names if name in LARGEST}
    for name in numbers:
        faults += table.not_finite(name, "correct or remove the line")
    if not faults:
        check_numbers(numbers, LARGEST, table.lines.tolist(), faults)
    refuse(faults.told())
    for name in names:
        if name not in LARGEST:
            warnings.add(f"the column `{name}` is not known; it is kept and not used", line=header)
    return DriveFile(file, header, numbers, tuple(warnings))


def compared_csv(columns: Mapping[str, Floats]) -> str:
    """Return columns of one length as CSV text, six significant digits."""
    out = io.StringIO()
    out.write(",".join(columns) + "\n")
    np.savetxt(out, np.column_stack(list(columns.values())), fmt="%.6g", delimiter=",")
    return out.getvalue()
