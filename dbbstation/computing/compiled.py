"""Compile numerical kernels and spread them over cores."""

from __future__ import annotations

import os
import threading
import warnings
from functools import cache
from itertools import pairwise
from types import FunctionType
from typing import TYPE_CHECKING, Any, TypeVar, cast

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from concurrent.futures import ThreadPoolExecutor


_told: list[Callable[[bool], None]] = []


def tell_of_compiling(tell: Callable[[bool], None]) -> None:
    """Call `tell` with True before and False after this process compiles a loop."""
    _told[:] = [tell]


def listen_to_compiler() -> None:
    """Report compilations to the listeners; code loaded from disk causes no report."""
    from numba.core import event  # noqa: PLC0415 - a third of a second, of which the compiler's user has paid already

    class CompileListener(event.Listener):
        """Counts nested compilations."""

        def __init__(self) -> None:
            self.depth = 0

        def on_start(self, _: object) -> None:
            self.depth += 1
            if self.depth == 1:
                for tell in _told:
                    tell(True)  # noqa: FBT003 - begun

        def on_end(self, _: object) -> None:
            self.depth -= 1
            if self.depth == 0:
                for tell in _told:
                    tell(False)  # noqa: FBT003 - ended

    event.register("numba:compile", CompileListener())  # type: ignore[no-untyped-call]


Item = TypeVar("Item")
Result = TypeVar("Result")
Kernel = TypeVar("Kernel", bound="Callable[..., Any]")

SMALLEST_BLOCK = 2048
"""Fewest poses per thread that repay starting it."""

REORDER = frozenset({"reassoc", "contract", "arcp", "nsz"})
"""Arithmetic changes allowed to the compiler: reorder sums, fuse multiplication with addition, multiply by reciprocals,
ignore the sign of zero. NaN and infinity must remain, because the kernels detect them."""


class NotKeptWarning(UserWarning):
    """Compiled code could not be stored on disk."""


NOT_KEPT = (
    "there is no folder that compiled loops can be kept in: every command compiles them again, which takes about ten seconds; "
    "name a folder that you may write to with NUMBA_CACHE_DIR"
)


def compiled(kernel: Kernel) -> Kernel:
    """Compile a loop at its first call and keep the code on disk.

    If neither the package folder nor the cache folder is writable, `NotKeptWarning` is issued once. Kernels release
    Python's global lock, so `in_blocks` can use threads; Numba's parallel loops abort when two threads enter them.
    """
    return cast("Kernel", _Kernel(kernel, cache=True, nogil=True))


def inlined(part: Kernel) -> Kernel:
    """Compile a function into each calling kernel: constant shapes then allow vector instructions (twice as fast)."""
    return cast("Kernel", _Kernel(part, forceinline=True))


class _Kernel:
    def __init__(self, function: Callable[..., Any], **options: bool) -> None:
        self._function = function
        self._options = options
        self._dispatcher: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any) -> Any:  # noqa: ANN401 - same arguments as the loop
        return (self._dispatcher or self.dispatcher())(*arguments)

    def dispatcher(self) -> Callable[..., Any]:
        """Return the compiled loop with its inlined parts."""
        with _COMPILING:
            if self._dispatcher is None:
                import numba  # noqa: PLC0415 - takes a third of a second

                _listen()
                function = cast("FunctionType", self._function)
                seen = {name: function.__globals__.get(name) for name in function.__code__.co_names}
                parts = {name: part.dispatcher() for name, part in seen.items() if isinstance(part, _Kernel)}
                whole = FunctionType(function.__code__, {**function.__globals__, **parts})
                how: Any = {"error_model": "numpy", "fastmath": set(REORDER), **self._options}
                try:
                    made = numba.njit(**how)(whole)
                except RuntimeError:  # raised before compilation: no folder for the code is writable
                    made = numba.njit(**{**how, "cache": False})(whole)
                    _say_not_kept()
                self._dispatcher = cast("Callable[..., Any]", made)
            return self._dispatcher


_listen = cache(listen_to_compiler)


@cache
def _say_not_kept() -> None:
    import multiprocessing  # noqa: PLC0415 - the same

    if multiprocessing.parent_process() is None:
        warnings.warn(NOT_KEPT, NotKeptWarning, stacklevel=2)


_COMPILING = threading.RLock()
"""Lock that makes simultaneous first calls compile a kernel once."""


def in_blocks(kernel: Callable[..., None], count: int, *arguments: Any) -> None:  # noqa: ANN401 - those of the kernel
    """Call `kernel(start, stop, *arguments)` for blocks of `range(count)`, on all cores if worthwhile."""
    workers = count // SMALLEST_BLOCK
    if workers > 1:  # asking for the cores takes as long as a short loop
        workers = min(workers, os.cpu_count() or 1)
    if workers <= 1 or _is_worker():
        kernel(0, count, *arguments)
        return
    edges = [count * worker // workers for worker in range(workers + 1)]
    blocks = [_pool().submit(kernel, start, stop, *arguments) for start, stop in pairwise(edges)]
    for block in blocks:
        block.result()


def in_parallel(work: Callable[[Item], Result], items: Iterable[Item], poses: int) -> list[Result]:
    """Call `work` on every item, on all cores if `poses` per item justify it; results in order.

    The first failing item's exception is raised.
    """
    if poses < SMALLEST_BLOCK or _is_worker():
        return [work(item) for item in items]
    return list(_pool().map(work, items))


@cache
def _pool() -> ThreadPoolExecutor:
    from concurrent.futures import ThreadPoolExecutor  # noqa: PLC0415 - every command imports this module

    return ThreadPoolExecutor(max_workers=os.cpu_count(), thread_name_prefix=_WORKER)


def _is_worker() -> bool:
    return threading.current_thread().name.startswith(_WORKER)


_WORKER = "dbbstation-kernel"
