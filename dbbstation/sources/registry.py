"""Every error source by name: one file each in `causes` and `unmodelled`, found by looking, not by a list."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from dbbstation.catalogue import in_folders, looked_up
from dbbstation.errors import ModelError
from dbbstation.sources import causes, unmodelled
from dbbstation.sources.contract import ErrorSource

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


HOW_TO_ADD = "one of your own is given with --source-file FILE.py, or its package installed"
"""What a name that nobody knows may lack."""


@cache
def known_sources() -> Mapping[str, ErrorSource]:
    """All error sources of the package, sorted by name."""
    return in_folders(ErrorSource, causes, unmodelled)  # type: ignore[type-abstract]  # what derives from it is made


def sources_named(names: Iterable[str], known: Mapping[str, ErrorSource] | None = None) -> tuple[ErrorSource, ...]:
    """Sources by their names.

    Args:
        names: of the sources.
        known: every error source by name; those of the package if None.

    Raises:
        ModelError: a name that no source has.
    """
    among = known_sources() if known is None else known
    return tuple(
        looked_up(name, among, called="error source", error=ModelError, how_to_add=HOW_TO_ADD) for name in names
    )
