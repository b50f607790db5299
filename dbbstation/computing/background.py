"""Run a function in a background thread and fetch its result later."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

_Outcome = TypeVar("_Outcome")


class Background(Generic[_Outcome]):
    """A function call that starts at once in a thread."""

    def __init__(self, work: Callable[[], _Outcome]) -> None:
        self._work = work
        self._found: list[_Outcome] = []
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="background", daemon=True)
        self._thread.start()

    @property
    def done(self) -> bool:
        """Return whether the call has ended."""
        return not self._thread.is_alive()

    def outcome(self) -> _Outcome:
        """Wait for the call and return its result, or raise its error."""
        self._thread.join()
        if self._error is not None:
            raise self._error
        return self._found[0]

    def wait(self, limit_s: float | None = None) -> None:
        """Wait for the call's end, at most `limit_s` seconds."""
        self._thread.join(limit_s)

    def _run(self) -> None:
        try:
            self._found.append(self._work())
        except Exception as error:  # noqa: BLE001 - raised again where the outcome is fetched
            self._error = error
