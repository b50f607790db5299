"""Load own physics on columns: classes of Python files that derive from `TableSource`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.files.own_classes import own_instances
from dbbstation.laws.contract import TableSource

if TYPE_CHECKING:
    from collections.abc import Container, Sequence
    from pathlib import Path

CONTRACT = "see `Physics of your own` in docs/mismatch.md"


def load_sources(
    files: Sequence[Path], columns: Container[str], where: str = "the table"
) -> tuple[list[TableSource], dict[str, str]]:
    """Return user physics whose columns exist, and the missing columns of other user physics by name.

    Raises:
        InputError: every fault: a file missing, not Python or without such a class, a missing requirement, a taken name.
    """
    usable: list[TableSource] = []
    lacking = {}
    for source in own_instances(files, TableSource, CONTRACT, ("name", "needs", "texts")):  # type: ignore[type-abstract]
        missing = [name for name in source.needs if name not in columns]
        if missing:
            lacking[source.name] = f"{where} has no column {', '.join(missing)}"
        else:
            usable.append(source)
    return usable, lacking
