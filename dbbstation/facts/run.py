"""The run that a fact is about."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class OfRun:
    """A fact about one run."""

    test: str
    direction: str
    repeat: int


@dataclass(frozen=True)
class OfRunInSession:
    """A fact about one run of one of several sessions."""

    session: str
    test: str
    direction: str
    repeat: int
