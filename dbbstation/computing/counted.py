"""How long work tells its progress."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from typing import TypeVar

Counted = Callable[[int, int], None]
"""Takes what is done, and of how much."""


Item = TypeVar("Item")


def uncounted(_done: int, _of: int) -> None:
    """Ignore the progress."""


def counting(items: Collection[Item], tell: Counted) -> Iterator[Item]:
    """Yield items, and tell before each and at the end how many are done."""
    for done, item in enumerate(items):
        tell(done, len(items))
        yield item
    tell(len(items), len(items))
