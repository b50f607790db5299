"""Worker processes on several cores that end at once when interrupted."""

from __future__ import annotations

import multiprocessing
import os
import threading
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.connection import wait
from typing import TYPE_CHECKING, TypeVar

from dbbstation.system.signals import started, starting

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator, Sequence

Item = TypeVar("Item")
Result = TypeVar("Result")


def each(work: Callable[[Item], Result], items: Sequence[Item], count: int) -> Generator[tuple[int, Result]]:
    """Yield each item's index and result as soon as it is done.

    Raises:
        Exception: whatever `work` raises.
    """
    left = dict(enumerate(items))
    if count > 1:
        try:
            with processes(count) as pool:
                with starting():
                    futures = {pool.submit(work, item): place for place, item in left.items()}
                for future in as_completed(futures):
                    result = future.result()
                    del left[futures[future]]
                    yield futures[future], result
        except BrokenProcessPool:
            pass
    for place, item in left.items():
        yield place, work(item)


@contextmanager
def processes(count: int) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool whose processes end with this one; submit work to it within `starting`."""
    # Started anew rather than forked: a fork would copy the locks of the threads that kernels run on.
    context = multiprocessing.get_context("spawn")
    with starting():
        made = ProcessPoolExecutor(count, mp_context=context, initializer=_end_with_parent)
    with made as pool:
        try:
            yield pool
        except BaseException:
            _say_nothing_of(pool)
            for child in multiprocessing.active_children():
                child.terminate()
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _end_with_parent() -> None:
    started()
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_after, args=(parent.sentinel,), name="end-with-parent", daemon=True).start()


def _end_after(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)


def _say_nothing_of(pool: ProcessPoolExecutor) -> None:
    before, handing_out = threading.excepthook, getattr(pool, "_executor_manager_thread", None)

    def hook(fault: threading.ExceptHookArgs) -> None:
        if fault.thread is not handing_out:
            before(fault)

    threading.excepthook = hook
