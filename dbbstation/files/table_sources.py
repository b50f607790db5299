"""Physics of one's own on a table: classes of Python files that derive from a contract which the caller names."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from dbbstation.files.own_classes import own_instances

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

_Contract = TypeVar("_Contract")

CONTRACT = "see `Physics of your own` in docs/mismatch.md"


def own_table_sources(files: Sequence[Path], base: type[_Contract]) -> list[_Contract]:
    """Instances of all classes of Python files that derive from a contract.

    Raises:
        InputError: every fault of every file: not there, not Python, no such class in it, something that the contract asks for
            and that is not there, a name that another one has.
    """
    return own_instances(files, base, CONTRACT, ("name", "needs", "texts"))
