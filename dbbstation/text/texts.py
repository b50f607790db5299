"""Texts that every cause has, for hexapods and single drives."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Texts:
    """Texts of a cause."""

    what: str
    shows: str
    confirm: str
    cure: str
    equation: str
    origin: str
