"""Rows of CSV text, cell by cell; a cell that no table has ends it with its line."""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING

from dbbstation.errors import InputError, Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator


def csv_rows(
    lines: Iterable[str], separator: str, file: str, *, first_line: int = 1, skip_spaces: bool = False
) -> Iterator[tuple[int, list[str]]]:
    """Yield the line number and the cells of each row.

    Args:
        lines: of the text, with or without their ends.
        separator: what stands between cells.
        file: as named in messages.
        first_line: number of the first of these lines in the file.
        skip_spaces: leave out spaces behind separators.

    Raises:
        InputError: a cell is longer than any text of a table, as behind a quotation mark that is never closed.
    """
    reader = csv.reader(lines, delimiter=separator, skipinitialspace=skip_spaces)
    while True:
        try:
            cells = next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            line = first_line - 1 + reader.line_num
            what = f"a cell has more than {csv.field_size_limit():,} characters"
            raise InputError(
                [Problem(file, line, 0, what, "check its quotation marks and which file it is")]
            ) from error
        yield first_line - 1 + reader.line_num, cells
