"""Load own physics on a table: classes of Python files that derive from the caller's contract."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from dbbstation.files.own_classes import own_instances

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

_Contract = TypeVar("_Contract")

CONTRACT = "see `Physics of your own` in docs/mismatch.md"


def own_table_sources(files: Sequence[Path], base: type[_Contract]) -> list[_Contract]:
    """Return instances of all classes that derive from a contract.

    Raises:
        InputError: every fault: a file missing, not Python or without such a class, a missing requirement, a taken name.
    """
    return own_instances(files, base, CONTRACT, ("name", "needs", "texts"))
