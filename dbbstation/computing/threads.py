"""One thread of linear algebra for the program's own narrow matrices.

Several BLAS threads would wait for each other between thousands of small products. A caller's matrices may need them,
so the limit ends with the fit.
"""

from __future__ import annotations

import threading
from concurrent.futures import Future
from functools import cache, wraps
from typing import TYPE_CHECKING, ParamSpec, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

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

    def __exit__(self, *_: object) -> None:
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


def in_background(work: Callable[[], _Outcome]) -> Future[_Outcome]:
    """Start a call in a thread that does not keep the program from ending."""
    found: Future[_Outcome] = Future()

    def run() -> None:
        try:
            found.set_result(work())
        except BaseException as error:  # noqa: BLE001 - raised again where the result is fetched
            found.set_exception(error)

    threading.Thread(target=run, name="background", daemon=True).start()
    return found
