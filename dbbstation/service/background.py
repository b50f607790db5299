"""Work of some seconds in a thread, so that a screen goes on drawing; its outcome is fetched, never delivered."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

_Outcome = TypeVar("_Outcome")


class Background(Generic[_Outcome]):
    """One piece of work, begun at once."""

    def __init__(self, work: Callable[[], _Outcome]) -> None:
        self._work = work
        self._found: list[_Outcome] = []
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="background", daemon=True)
        self._thread.start()

    @property
    def done(self) -> bool:
        """Whether it has ended."""
        return not self._thread.is_alive()

    def outcome(self) -> _Outcome:
        """Return what it found, waiting for that; raises what it raised."""
        self._thread.join()
        if self._error is not None:
            raise self._error
        return self._found[0]

    def wait(self) -> None:
        """Wait for its end, whatever that is."""
        self._thread.join()

    def _run(self) -> None:
        try:
            self._found.append(self._work())
        except Exception as error:  # noqa: BLE001 - raised again where the outcome is fetched
            self._error = error
