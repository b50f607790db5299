"""Report the progress of tasks, and stop them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypedDict

from dbbstation.errors import StationError

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.computing.counted import Counted


READING = "reading runs"
"""Stage of a task that reads sessions."""


class StoppedError(StationError):
    """The caller stopped the work; nothing was written."""


class Progress(Protocol):
    """Receives the progress of work."""

    def __call__(self, text: str, done: int = 0, of: int = 0) -> None:
        """Receive the name of a stage and, if countable, its completed part."""


def silent(text: str, done: int = 0, of: int = 0) -> None:
    """Ignore progress."""


def never() -> bool:
    """Never stop."""
    return False


class Hooks(TypedDict, total=False):
    """Arguments of every task; `Telling` has their defaults."""

    progress: Progress
    stop: Callable[[], bool]
    say: Callable[[str], None]


class Telling:
    """Reports stages and notes, and stops at the next stage on request."""

    def __init__(
        self, progress: Progress = silent, stop: Callable[[], bool] = never, say: Callable[[str], None] = silent
    ) -> None:
        self.notes: list[str] = []
        self._progress = progress
        self._stop = stop
        self._say = say

    def stage(self, text: str, done: int = 0, of: int = 0) -> None:
        """Report a stage.

        Raises:
            StoppedError: the work is to stop.
        """
        if self._stop():
            raise StoppedError("the work was stopped", where=text)
        self._progress(text, done, of)

    def counted(self, text: str) -> Counted:
        """Return a callback for the completed pieces of a stage."""
        return lambda done, of: self.stage(text, done, of)

    def note(self, *texts: str) -> None:
        """Report a note."""
        for text in texts:
            self.notes.append(text)
            self._say(text)
