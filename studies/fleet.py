"""The same experiment on many random machines, on all cores, with what is done so far kept at an interruption."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

Result = TypeVar("Result")

TOGETHER = 4
"""Machines that a process is handed at once."""


def over_machines(experiment: Callable[[int], Result], seeds: Sequence[int]) -> Iterator[Result]:
    """Yield the experiment's result for every seed, in the order of the seeds.

    Args:
        experiment: can be sent to another process: a function of a module, or a `functools.partial` of one.
        seeds: of the machines.
    """
    cores = os.cpu_count() or 1
    if cores == 1 or len(seeds) <= TOGETHER:
        yield from map(experiment, seeds)
        return
    with processes(cores) as pool:
        with deaf():
            results = pool.map(experiment, seeds, chunksize=TOGETHER)
        yield from results


@contextmanager
def processes(count: int) -> Iterator[ProcessPoolExecutor]:
    """Yield processes to work in, which end at once where this one is interrupted; hand them work while `deaf`."""
    # Started anew rather than forked: a fork would copy the locks of the threads that kernels run on.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(count, mp_context=context) as pool:
        try:
            yield pool
        except BaseException:
            _say_nothing_of(pool)
            for child in multiprocessing.active_children():
                child.terminate()
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _say_nothing_of(pool: ProcessPoolExecutor) -> None:
    """Keep the thread that hands out a pool's work quiet: its processes are gone, which was asked for and is no news."""
    before, handing_out = threading.excepthook, getattr(pool, "_executor_manager_thread", None)

    def hook(fault: threading.ExceptHookArgs) -> None:
        if fault.thread is not handing_out:
            before(fault)

    threading.excepthook = hook


@contextmanager
def deaf() -> Iterator[None]:
    """Ignore Ctrl-C: processes that are started now ignore it as long as they live, and this one alone answers it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
