"""`--source-files`, for commands that fit or read a model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from collections.abc import Callable

_Function = TypeVar("_Function", bound="Callable[..., Any]")


def source_file_option(function: _Function) -> _Function:
    """Give a command `source_files`, a tuple of paths."""
    return click.option(
        "--source-files",
        "source_files",
        multiple=True,
        type=click.Path(path_type=Path),
        metavar="FILE.py",
        help="Python file with an error source of your own. It is executed. May be given more than once.",
    )(function)
