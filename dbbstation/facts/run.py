"""The run that a fact is about."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class OfRun:
    """A fact about one run."""

    test: str
    direction: str
    repeat: int

    @property
    def key(self) -> tuple[str, str, int]:
        """Return what tells the run from the others of its session."""
        return self.test, self.direction, self.repeat

    @property
    def label(self) -> str:
        """Return the name for messages and file, such as `a-ccw-1`."""
        return f"{self.test}-{self.direction}-{self.repeat}"


@dataclass(frozen=True)
class OfRunInSession:
    """A fact about one run of one of several sessions."""

    session: str
    test: str
    direction: str
    repeat: int
