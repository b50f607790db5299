"""How long work tells its progress."""

from __future__ import annotations

from collections.abc import Callable

Counted = Callable[[int, int], None]
"""Takes what is done, and of how much."""


def uncounted(_done: int, _of: int) -> None:
    """Tell nobody."""
