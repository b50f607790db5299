"""Models for tasks: loaded, in a file, or in a result."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from dbbstation.files.formats.model import read_model as read_model_file
from dbbstation.files.formats.model import write_model as write_model_file
from dbbstation.files.own_sources import every_source
from dbbstation.model.identified import IdentifiedModel
from dbbstation.tasks.declare import paths_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.files.provenance import Provenance
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.declare import Files


class HasModel(Protocol):
    """A result with a model."""

    @property
    def model(self) -> IdentifiedModel:
        """Return the model."""


Model = str | PathLike[str] | IdentifiedModel | HasModel
"""A file, a model, or a result with a model."""


def model_of(model: Model, known: Mapping[str, ErrorSource] | None = None) -> IdentifiedModel:
    """Return a model, read if it is a file.

    Args:
        known: error sources by name; None: those of package and installed packages.

    Raises:
        InputError: every fault with its place.
    """
    if isinstance(model, str | PathLike):
        return read_model_file(Path(model), every_source() if known is None else known)
    return model if isinstance(model, IdentifiedModel) else model.model


def sources_known(known: Mapping[str, ErrorSource] | None, source_files: Files) -> Mapping[str, ErrorSource]:
    """Return error sources by name; None: those of package, installed packages and files."""
    return every_source(paths_of(source_files)) if known is None else known


def read_model(path: str | PathLike[str], *, source_files: Sequence[str | PathLike[str]] = ()) -> IdentifiedModel:
    """Read a model of `calibrate` or `diagnose`.

    Args:
        path: file.
        source_files: own error sources that it names; they are executed.

    Raises:
        InputError: every fault of the files with its place.
    """
    return read_model_file(Path(path), every_source([Path(file) for file in source_files]))


def write_model(
    path: str | PathLike[str], model: Model, *, provenance: Provenance | None = None, force: bool = False
) -> None:
    """Write a model, completely or not at all.

    Args:
        path: file.
        model: a model, or the result of `calibrate` or `diagnose`.
        provenance: None: not stated.
        force: overwrite an existing file.

    Raises:
        OutputError: the file exists without `force`, or the disk refuses.
    """
    write_model_file(Path(path), model_of(model), provenance=provenance, force=force)
