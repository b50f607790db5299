"""The same experiment on many random machines, on all cores, with what is done so far kept at an interruption."""

from __future__ import annotations

import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor
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
    # Started anew rather than forked: a fork would copy the locks of the threads that kernels run on.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(cores, mp_context=context) as pool:
        try:
            yield from pool.map(experiment, seeds, chunksize=TOGETHER)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
