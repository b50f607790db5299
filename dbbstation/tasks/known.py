"""What is known by its name: error sources and instruments."""

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
    """Return the causes of error that are known: the package's, those of installed packages, those of Python files.

    Args:
        source_files: Python files with error sources of one's own; they are executed.
        machine: file of a machine, on which each says its parameters; None: parameters are left out.

    Raises:
        InputError: every fault of every file and entry point.
        ModelError: the machine lacks what a source needs.
    """
    nominal = None if machine is None else read_machine(Path(machine))
    every = every_source([Path(file) for file in source_files])
    return tuple(source_description(source, nominal) for source in every.values())
