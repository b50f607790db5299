"""What every task tells while it works, and how it is asked to stop."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from dbbstation.errors import StationError

if TYPE_CHECKING:
    from collections.abc import Callable


class StoppedError(StationError):
    """Whoever asked for the work stopped it; nothing was written."""


class Progress(Protocol):
    """What is told how far work has come."""

    def __call__(self, text: str, done: int = 0, of: int = 0) -> None:
        """Take a stage, and how much of it is done where that can be counted."""


def silent(text: str, done: int = 0, of: int = 0) -> None:
    """Tell nobody."""


def never() -> bool:
    """Never stop."""
    return False


class Telling:
    """Hands on stages and notes, and stops the work at the next stage once that is asked for.

    Args:
        progress: told each stage as it begins.
    """

    def __init__(
        self, progress: Progress = silent, stop: Callable[[], bool] = never, say: Callable[[str], None] = silent
    ) -> None:
        self.notes: list[str] = []
        self._progress = progress
        self._stop = stop
        self._say = say

    def stage(self, text: str, done: int = 0, of: int = 0) -> None:
        """Tell a stage.

        Raises:
            StoppedError: the work is to stop.
        """
        if self._stop():
            raise StoppedError("the work was stopped", where=text)
        self._progress(text, done, of)

    def counted(self, text: str) -> Callable[[int, int], None]:
        """Return what is to be told how many of how many pieces of a stage are done."""
        return lambda done, of: self.stage(text, done, of)

    def note(self, *texts: str) -> None:
        """Tell what was noticed."""
        for text in texts:
            self.notes.append(text)
            self._say(text)
