"""`--model`, for commands that judge circles while measuring."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from dbbstation.cli.shared_options import source_file_option

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.model.identified import IdentifiedModel

_Function = TypeVar("_Function", bound="Callable[..., Any]")


def judging_model_options(function: _Function) -> _Function:
    """Give a command `--model` and `--source-files` for `judging_model`."""
    option = click.option(
        "--model",
        "model_file",
        type=click.Path(path_type=Path, dir_okay=False),
        help="Judge circles by this calibrated model of the machine, not by its nominal geometry.",
    )
    return option(source_file_option(function))


def judging_model(model_file: Path | None, source_files: Sequence[Path]) -> IdentifiedModel | None:
    """Return the model of expected circles, or None.

    Raises:
        InputError: every fault with its place.
    """
    if model_file is None:
        return None
    from dbbstation.files.formats.model import read_model
    from dbbstation.files.own_sources import every_source

    return read_model(model_file, every_source(source_files))
