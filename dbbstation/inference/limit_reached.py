"""Limits at which a computation ended."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LimitReached:
    """A limit at which a computation ended.

    Attributes:
        what: `search`, `parameter`, `fit` or `stopped`.
        name: source and parameter, such as `play shaking_n`; may be empty.
    """

    what: str
    name: str
    text: str
