"""How numerical kernels are compiled and spread over the processor's cores."""

from __future__ import annotations

import os
import threading
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numba

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

Item = TypeVar("Item")
Result = TypeVar("Result")
Kernel = TypeVar("Kernel", bound="Callable[..., Any]")

SMALLEST_BLOCK = 2048
"""Poses per thread below which starting a thread costs more than it gains."""

REORDER = frozenset({"reassoc", "contract", "arcp", "nsz"})
"""What the compiler may do to arithmetic: reorder sums, fuse multiplication with addition, multiply by reciprocals,
forget the sign of zero. It may not assume that there is no NaN and no infinity, which the kernels have to notice."""


def compiled(kernel: Kernel) -> Kernel:
    """Compile a loop to machine code at its first call and keep the code on disk for the next process.

    The kernel runs without Python's global lock, so that `in_blocks` can run it on all cores. Numba's own
    parallel loops are not used: their default thread layer aborts the process when two threads enter it.
    """
    return cast("Kernel", numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=set(REORDER))(kernel))


def inlined(part: Kernel) -> Kernel:
    """Make a part of kernels that is compiled into each of them.

    Seen from inside the kernel its work arrays have constant shapes and do not overlap: only so does the compiler
    turn loops into vector instructions (twice the speed of calls).
    """
    return cast("Kernel", numba.njit(forceinline=True, error_model="numpy", fastmath=set(REORDER))(part))


def in_blocks(kernel: Callable[[int, int], None], count: int) -> None:
    """Call `kernel(start, stop)` for blocks that cover `range(count)`, on all cores where that pays."""
    workers = 1 if _is_worker() else min(os.cpu_count() or 1, count // SMALLEST_BLOCK)
    if workers <= 1:
        kernel(0, count)
        return
    edges = [count * worker // workers for worker in range(workers + 1)]
    blocks = [_pool().submit(kernel, start, stop) for start, stop in pairwise(edges)]
    for block in blocks:
        block.result()


def in_parallel(work: Callable[[Item], Result], items: Iterable[Item], poses: int) -> list[Result]:
    """Call `work` on every item, on all cores where so many `poses` per item make it pay; results in order.

    What an item's work does in blocks stays on its own core. An exception is that of the first item that fails.
    """
    if poses < SMALLEST_BLOCK or _is_worker():
        return [work(item) for item in items]
    return list(_pool().map(work, items))


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max_workers=os.cpu_count(), thread_name_prefix=_WORKER)


def _is_worker() -> bool:
    """Whether this is one of the pool's threads: waiting for others of them, all could wait for each other."""
    return threading.current_thread().name.startswith(_WORKER)


_WORKER = "dbbstation-kernel"
