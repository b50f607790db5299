"""Progress and stopping of tasks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from dbbstation.errors import StationError

if TYPE_CHECKING:
    from collections.abc import Callable


class StoppedError(StationError):
    """The caller stopped the work; nothing was written."""


class Progress(Protocol):
    """Receives the progress of work."""

    def __call__(self, text: str, done: int = 0, of: int = 0) -> None:
        """Take a stage, and its completed part if countable."""


def silent(text: str, done: int = 0, of: int = 0) -> None:
    """Ignore progress."""


def never() -> bool:
    """Never stop."""
    return False


class Telling:
    """Passes on stages and notes, and stops at the next stage if asked."""

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
        """Return a callback for the pieces done in a stage."""
        return lambda done, of: self.stage(text, done, of)

    def note(self, *texts: str) -> None:
        """Tell what was noticed."""
        for text in texts:
            self.notes.append(text)
            self._say(text)
