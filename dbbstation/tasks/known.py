"""Known error sources and instruments by name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.own_sources import every_source
from dbbstation.results.sources import SourceDescription, source_description

if TYPE_CHECKING:
    from collections.abc import Sequence
    from os import PathLike


def known_sources(
    *, source_files: Sequence[str | PathLike[str]] = (), machine: str | PathLike[str] | None = None
) -> tuple[SourceDescription, ...]:
    """Return the known causes from the package, installed packages and Python files.

    Args:
        source_files: own error sources; they are executed.
        machine: file whose parameters are shown; None: without parameters.

    Raises:
        InputError: every fault of every file and entry point.
        ModelError: the machine lacks data that a source needs.
    """
    nominal = None if machine is None else read_machine(Path(machine))
    every = every_source([Path(file) for file in source_files])
    return tuple(source_description(source, nominal) for source in every.values())
