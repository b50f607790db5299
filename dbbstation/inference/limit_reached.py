"""What ended at a limit, so that whoever reads an answer knows what it leaves open."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LimitReached:
    """One thing that ended at a limit.

    Attributes:
        what: `search`, `parameter`, `fit` or `stopped`.
        name: source and parameter, such as `play shaking_n`; empty where it is none.
        text: one or two sentences for people.
    """

    what: str
    name: str
    text: str
