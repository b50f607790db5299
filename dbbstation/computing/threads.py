"""One thread of linear algebra where the program's own matrices are worked on.

The matrices of a fit are narrow. Threads of the linear algebra (BLAS) cost more there than they save: they wait for each
other between thousands of small products. Whoever calls the program from Python has other matrices, too; so the threads are
limited while a fit runs and are given back behind it.
"""

from __future__ import annotations

import threading
from functools import cache, wraps
from typing import TYPE_CHECKING, ParamSpec, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

    from threadpoolctl import LibController

Asked = ParamSpec("Asked")
Result = TypeVar("Result")


def with_one_thread(work: Callable[Asked, Result]) -> Callable[Asked, Result]:
    """Make a function run with one thread of linear algebra, whoever calls it, and give the threads back behind it.

    The limit is the process's: while the function runs, other threads of Python have one thread of linear algebra, too.
    """

    @wraps(work)
    def limited(*args: Asked.args, **kwargs: Asked.kwargs) -> Result:
        with _LIMIT:
            return work(*args, **kwargs)

    return limited


class _Limit:
    """Counts who works: the first that begins sets the limit, the last that ends gives the threads back."""

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
    """Set how many threads a library has, from whatever thread of Python.

    threadpoolctl lets only the thread that set a limit first set another. Here the last that ends may be another one than the
    first that began: `_Limit` keeps order itself.
    """
    release = getattr(library, "clear_controlling_thread", lambda **_: None)  # from threadpoolctl 3.8 on
    release(force=True)
    library.set_num_threads(count)
    release(force=True)


@cache
def _libraries() -> list[LibController]:
    """Libraries of linear algebra of this process: those of NumPy and of SciPy, which bring one each."""
    import numpy as np  # noqa: F401, PLC0415 - loaded here, so that both are found
    import scipy.linalg  # noqa: F401, PLC0415
    from threadpoolctl import ThreadpoolController  # noqa: PLC0415 - whoever only asks for help does not wait for it

    return ThreadpoolController().select(user_api="blas").lib_controllers
