"""The result of `export`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ExportResult:
    """A written table."""

    table: str
    runs: int
    rows: int
    columns: tuple[str, ...]
