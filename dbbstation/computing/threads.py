"""One thread of linear algebra for the program's own narrow matrices.

Several BLAS threads would wait for each other between thousands of small products. A caller's matrices may need them,
so the limit ends with the fit.
"""

from __future__ import annotations

import threading
from functools import cache, wraps
from typing import TYPE_CHECKING, Generic, ParamSpec, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

    from threadpoolctl import LibController

Asked = ParamSpec("Asked")
Result = TypeVar("Result")


def with_one_thread(work: Callable[Asked, Result]) -> Callable[Asked, Result]:
    """Run a function with one thread of linear algebra."""

    @wraps(work)
    def limited(*args: Asked.args, **kwargs: Asked.kwargs) -> Result:
        with _LIMIT:
            return work(*args, **kwargs)

    return limited


class _Limit:
    """Counts running functions: the first sets the limit, the last removes it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._working = 0
        self._before: list[tuple[LibController, int]] = []

    def __enter__(self) -> None:
        with self._lock:
            self._working += 1
            if self._working == 1:
                self._before = [(library, library.get_num_threads()) for library in _libraries()]
                for library, _ in self._before:
                    _set(library, 1)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._lock:
            self._working -= 1
            if self._working == 0:
                for library, count in self._before:
                    _set(library, count)


_LIMIT = _Limit()


def _set(library: LibController, count: int) -> None:
    """Set a library's number of threads from any Python thread.

    threadpoolctl allows only the first thread to reset a limit, so `_Limit` keeps order itself.
    """
    release = getattr(library, "clear_controlling_thread", lambda **_: None)  # from threadpoolctl 3.8 on
    release(force=True)
    library.set_num_threads(count)
    release(force=True)


@cache
def _libraries() -> list[LibController]:
    import numpy as np  # noqa: F401, PLC0415 - loaded here, so that both are found
    import scipy.linalg  # noqa: F401, PLC0415
    from threadpoolctl import ThreadpoolController  # noqa: PLC0415 - `--help` need not load it

    return ThreadpoolController().select(user_api="blas").lib_controllers


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
