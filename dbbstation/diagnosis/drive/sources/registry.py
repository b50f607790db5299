"""Find causes of force by name, in this folder."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from dbbstation.catalogue import in_folders, looked_up
from dbbstation.diagnosis.drive import sources
from dbbstation.diagnosis.drive.contract import DriveSource
from dbbstation.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


@cache
def known_drive_sources() -> Mapping[str, DriveSource]:
    """Return all causes, sorted by name."""
    return in_folders(DriveSource, sources)  # type: ignore[type-abstract] # subclasses are instantiated


def drive_sources_named(names: Iterable[str]) -> tuple[DriveSource, ...]:
    """Return causes by name.

    Raises:
        ModelError: an unknown name.
    """
    known = known_drive_sources()
    return tuple(looked_up(name, known, called="cause of force in a drive", error=ModelError) for name in names)
