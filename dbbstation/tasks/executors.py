"""Run work in processes of this computer or on a Dask scheduler's workers."""

from __future__ import annotations

from collections import deque
from concurrent.futures import BrokenExecutor, CancelledError, as_completed, wait
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from dbbstation.computing.threads import in_background
from dbbstation.errors import StationError
from dbbstation.files.keys import differences_of, program_identity
from dbbstation.system.processes import processes
from dbbstation.system.signals import starting

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator, Sequence
    from concurrent.futures import Executor

Item = TypeVar("Item")
Result = TypeVar("Result")

REACHED_S = 10.0
"""Longest wait for the answer of a scheduler, and for its first worker [s]."""


class SchedulerError(StationError):
    """A scheduler is missing, or its workers are missing or have another program."""


@dataclass(frozen=True)
class Ended:
    """A piece of work ended its process, even when it ran alone."""

    problem: str


@dataclass(frozen=True)
class WorkPool(Generic[Item, Result]):
    """The processes that do the work.

    Attributes:
        scheduler: such as `tcp://server:8786`; empty for this computer.
    """

    count: int = 1
    scheduler: str = ""

    def executor(self, count: int) -> AbstractContextManager[Executor]:
        """Return the context of an executor, which ends when this process is interrupted.

        Raises:
            SchedulerError: no such scheduler; its workers have another program or several threads.
        """
        return _of_dask(self.scheduler) if self.scheduler else processes(count)

    def each(self, work: Callable[[Item], Result], items: Sequence[Item]) -> Generator[tuple[int, Result | Ended]]:
        """Yield the index and result of each item once, in order of completion.

        Raises:
            SchedulerError: as `executor`; or the scheduler disappeared.
            Exception: whatever `work` raises.
        """
        left = deque(range(len(items)))
        while left:
            count = min(self.count, len(left))
            broken = yield from self._in_pool(work, items, left, count)
            suspects = [left.popleft() for _ in range(min(count, len(left)))] if broken else []
            for place in suspects:
                alone = deque([place])
                if (yield from self._in_pool(work, items, alone, 1)):
                    yield place, Ended("its process was ended, twice: by the system, where memory ran out")

    def _in_pool(
        self, work: Callable[[Item], Result], items: Sequence[Item], left: deque[int], count: int
    ) -> Generator[tuple[int, Result | Ended], None, bool]:
        with self.executor(count) as pool:
            with starting():
                futures = {pool.submit(work, items[place]): place for place in left}
            for future in as_completed(futures):
                place = futures.pop(future)
                try:
                    result: Result | Ended = future.result()
                except BrokenExecutor:
                    return True
                except CancelledError as error:
                    raise SchedulerError(
                        "the scheduler went away", where=self.scheduler, remedy="start it, and repeat the command"
                    ) from error
                except Exception as error:
                    if not (type(error).__name__ == "KilledWorker"):
                        raise
                    result = Ended("its worker was ended, several times: by the system, where memory ran out")
                left.remove(place)
                yield place, result
        return False


@contextmanager
def _of_dask(address: str) -> Iterator[Executor]:
    try:
        from distributed import Client
    except ImportError as error:
        remedy = "install it with `pip install 'dbbstation[dask]'`"
        raise SchedulerError("distributed, Dask's scheduler, is not installed", remedy=remedy) from error
    try:
        client = _within(REACHED_S, lambda: Client(address, timeout=REACHED_S, set_as_default=False))
    except (OSError, TimeoutError, ValueError) as error:
        what = f"no scheduler answers: {str(error) or type(error).__name__}"
        raise SchedulerError(
            what, where=address, remedy="check the address; docs/fleet.md says how to start one"
        ) from error
    try:
        _check_workers(client, address)
        pool = client.get_executor(pure=False)
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False)
            raise
    finally:
        client.close()


def _within(limit_s: float, act: Callable[[], Any]) -> Any:  # noqa: ANN401 - what it returns
    """Return a function's result within a time limit; Dask's own limit does not cover a connected, but silent server."""
    work = in_background(act)
    wait([work], limit_s)
    if not work.done():
        raise TimeoutError(f"nothing within {limit_s:g} s")
    return work.result()


def _check_workers(client: Any, address: str) -> None:  # noqa: ANN401 - distributed ships no types
    try:
        client.wait_for_workers(1, timeout=REACHED_S)
    except TimeoutError as error:
        raise SchedulerError("the scheduler has no workers", where=address, remedy="start some") from error
    for worker, about in client.scheduler_info(n_workers=-1)["workers"].items():
        if about["nthreads"] != 1:
            what = f"the worker {worker} has {about['nthreads']} threads, which wait for one another"
            raise SchedulerError(what, where=address, remedy="start workers with --nthreads 1, one for each core")
    try:
        found = _within(REACHED_S, lambda: client.run(program_identity))
    except Exception as error:
        what = f"a worker has no dbbstation, or another one: {type(error).__name__}: {error}"
        raise SchedulerError(what, where=address, remedy="install the same version there") from error
    for worker, identity in found.items():
        refuse_other_program(identity, f"the worker {worker}")


def refuse_other_program(identity: dict[str, str], whose: str) -> None:
    """Refuse workers with another program, because their numbers may differ.

    Raises:
        SchedulerError: a worker's program differs.
    """
    if unlike := differences_of(program_identity(), identity):
        raise SchedulerError(f"{whose} has another program: {unlike}", remedy="install the same version everywhere")
