"""A table of samples: the result of `export`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ExportResult:
    """A table that was written.

    Attributes:
        table: its file.
        runs: in it.
        rows: in it, one for each sample.
        columns: names, with units.
    """

    table: str
    runs: int
    rows: int
    columns: tuple[str, ...]
