"""The results of `import` and `export`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class TakenRun:
    """A run of the new session."""

    file: str
    run: str
    samples: int
    computed: tuple[str, ...]


@dataclass(frozen=True)
class ImportResult:
    """Imported recordings.

    Attributes:
        written: False for a dry run.
        statements: assumptions, computations and omissions, noted in the session.
    """

    session: str
    written: bool
    mapping: Mapping[str, object]
    runs: tuple[TakenRun, ...]
    statements: tuple[str, ...]


@dataclass(frozen=True)
class ExportResult:
    """A written table."""

    table: str
    runs: int
    rows: int
    columns: tuple[str, ...]
