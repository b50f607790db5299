"""The result of `export`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ExportResult:
    """A table that was written."""

    table: str
    runs: int
    rows: int
    columns: tuple[str, ...]
