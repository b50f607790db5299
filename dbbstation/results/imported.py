"""Recordings that another program made, as a session: the result of `import`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class TakenRun:
    """A run of the new session.

    Attributes:
        computed: what was worked out and is in no file.
    """

    file: str
    run: str
    samples: int
    computed: tuple[str, ...]


@dataclass(frozen=True)
class ImportResult:
    """What was taken in.

    Attributes:
        written: whether it was; False for a dry run.
        mapping: what columns mean, as the mapping's file has it.
        statements: what was assumed, worked out or left out; the session notes them.
    """

    session: str
    written: bool
    mapping: Mapping[str, object]
    runs: tuple[TakenRun, ...]
    statements: tuple[str, ...]
