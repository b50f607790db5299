"""Bars of studies."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from dbbstation.cli.progress import count_bar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


@contextmanager
def progress_bar(label: str, total: int) -> Iterator[Callable[[int], None]]:
    """Show a bar; yield a callback for the completed part of `total`."""
    with count_bar(label) as tell:
        yield lambda done: tell(done, total)
