"""One experiment on many random machines, on all cores, resumable."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, TypeVar

from dbbstation.system.processes import processes
from dbbstation.system.signals import starting

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

Result = TypeVar("Result")

TOGETHER = 4
"""Machines that a process is handed at once."""


def over_machines(experiment: Callable[[int], Result], seeds: Sequence[int]) -> Iterator[Result]:
    """Yield results in the order of seeds.

    Args:
        experiment: can be pickled.
    """
    cores = os.cpu_count() or 1
    if cores == 1 or len(seeds) <= TOGETHER:
        yield from map(experiment, seeds)
        return
    with processes(cores) as pool:
        with starting():
            results = pool.map(experiment, seeds, chunksize=TOGETHER)
        yield from results
