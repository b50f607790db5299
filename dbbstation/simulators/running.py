"""Run each simulation once, in processes on all cores, with limits of time and number."""

from __future__ import annotations

import os
import pickle
from concurrent.futures import TimeoutError as TooLongError
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

from dbbstation.catalogue import FOREIGN, in_words, line_in
from dbbstation.diagnosis.simulator.contract import simulated
from dbbstation.diagnosis.simulator.work import BudgetSpentError, told
from dbbstation.errors import CalibrationError
from dbbstation.simulators.kept import KeptSimulations
from dbbstation.simulators.loading import know, simulator_of
from dbbstation.system.processes import processes
from dbbstation.system.signals import starting

if TYPE_CHECKING:
    from collections.abc import Sequence
    from concurrent.futures import Future, ProcessPoolExecutor
    from types import TracebackType
    from typing import Self

    from dbbstation.diagnosis.simulator.model import Model, SimulationOutcome, SimulationRequest
    from dbbstation.simulators.exchanged import ExchangedSimulator
    from dbbstation.simulators.loading import LoadedSimulator

MOST_SECONDS = 600.0
"""Total time of the simulations if their number is not limited [s]."""

SHORTEST_S = 1e-4
"""Least assumed time of a simulation [s], about the time to pass it to another process."""

TOGETHER = 8
"""Number of simulations that are passed to a process at once, because passing takes a millisecond."""


class Runs:
    """Simulations of one simulator; a context manager.

    Args:
        count: of processes; None: one per core; 0: this one, without time limit.
        most: allowed simulations; None: ten minutes' worth, estimated while running.
        keeps: keep simulations on disk and reuse them.

    Attributes:
        most: allowed simulations; None: ten minutes' worth, estimated while running.
    """

    def __init__(
        self, loaded: LoadedSimulator, count: int | None = None, most: int | None = None, *, keeps: bool = False
    ) -> None:
        self._loaded, self._model = loaded, loaded.model
        self._count = (os.cpu_count() or 1) if count is None else count
        self._known: dict[SimulationRequest, SimulationOutcome] = {}
        self._pool: ProcessPoolExecutor | None = None
        self._stack = ExitStack()
        self.ran, self.found, self.most, self.seconds = 0, 0, most, 0.0
        self._by_time = False
        self._kept = KeptSimulations(loaded.content, loaded.model) if keeps else None
        if self._kept is not None:
            self._stack.callback(self._kept.close)
        outputs = len(self._model.outputs)
        self._shapes = {k: (outputs, len(run)) for k, run in enumerate(self._model.runs)}

    def __enter__(self) -> Self:
        if self._count:
            self._pool = self._stack.enter_context(processes(self._count))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End all processes."""
        self._stack.__exit__(kind, error, trace)

    def __call__(self, asks: Sequence[SimulationRequest]) -> list[SimulationOutcome]:
        """Return all answers; stored ones are reused.

        Raises:
            BudgetSpentError: more simulations than allowed.
            CalibrationError: a simulation failed, returned something invalid, or took too long; names its input.
        """
        fresh = [ask for ask in dict.fromkeys(asks) if ask not in self._known]
        if self._kept is not None and fresh:
            kept = self._kept.known(fresh, self._shapes)
            self._known |= kept
            self.found += len(kept)
            fresh = [ask for ask in fresh if ask not in kept]
        self._refuse_beyond(len(fresh))
        before = monotonic()
        new = list(zip(fresh, self._simulated(fresh), strict=True))
        self._known |= new
        if self._kept is not None:
            self._kept.keep(new)
        self.seconds += monotonic() - before
        self.ran += len(fresh)
        if self._by_time and self.ran:
            self.most = max(int(self.ran * MOST_SECONDS / max(self.seconds, SHORTEST_S * self.ran)), self.ran)
        return [self._known[ask] for ask in asks]

    def _refuse_beyond(self, more: int) -> None:
        if self._by_time:
            if not more or self.seconds < MOST_SECONDS:
                return
            what = f"{MOST_SECONDS / 60.0:.0f} minutes of simulations are spent, {self.ran} of them"
        elif self.most is None or self.ran + more <= self.most:
            return
        else:
            what = f"{self.ran} of {self.most} simulations are spent"
        raise BudgetSpentError(what, where=str(self._loaded.path), remedy="allow more with --most-runs")

    @property
    def left_s(self) -> float | None:
        """Return the approximate remaining time [s]; None without limit."""
        if self.most is None or not self.ran:
            return None
        return (self.most - self.ran) * self.seconds / self.ran

    def allow(self, first: Sequence[SimulationRequest]) -> float:
        """Run a first simulation and return its time [s]; set the allowed number if it is unset."""
        self(first)
        again = list(dict.fromkeys(first))
        if not self.ran:
            self._simulated(again)  # it was kept: whatever a process does once only is no part of a simulation's time
        before = monotonic()
        self._simulated(again)
        one = max((monotonic() - before) / max(len(again), 1), SHORTEST_S)
        if self.most is None:
            # How long simulations take is known better the more were run: what is allowed is the time.
            self._by_time, self.most = True, int(MOST_SECONDS / one) * max(self._count, 1)
        self.seconds = one * self.ran
        return one

    def _simulated(self, asks: Sequence[SimulationRequest]) -> list[SimulationOutcome]:
        if self._pool is None:
            return [_one(self._loaded.source, self._model, ask) for ask in asks]
        together = max(min(TOGETHER, len(asks) // (2 * self._count)), 1)
        parts = [asks[k : k + together] for k in range(0, len(asks), together)]
        loaded = self._loaded
        try:
            with starting():
                futures = [
                    self._pool.submit(_several, loaded.source, loaded.own_files, self._model, pickle.dumps(part))
                    for part in parts
                ]
            return [
                answer for part, future in zip(parts, futures, strict=True) for answer in self._result(part, future)
            ]
        except BrokenProcessPool as error:
            what = "a process that simulates was ended"
            raise CalibrationError(
                what, where=told(self._model, asks[0]), remedy="it may need more memory, or crash on that computer"
            ) from error

    def _result(
        self, part: Sequence[SimulationRequest], future: Future[list[SimulationOutcome]]
    ) -> list[SimulationOutcome]:
        limit = self._loaded.file.time_limit_s
        # Those before it in the queue take their time, too, and a process is started first.
        allowed = STARTING_S + limit * len(part) * 2.0
        try:
            return future.result(allowed)
        except TooLongError:
            for process in getattr(self._pool, "_processes", {}).values():
                process.terminate()
            what = f"a simulation takes longer than {limit:g} s"
            remedy = "raise `time_limit_s`, or narrow the bounds of the parameters"
            raise CalibrationError(what, where=told(self._model, part[0]), remedy=remedy) from None


STARTING_S = 20.0
"""Longest time until a process begins to simulate [s]."""


def _several(
    source: Path | ExchangedSimulator, own_files: tuple[Path, ...], model: Model, asks: bytes
) -> list[SimulationOutcome]:
    know(own_files)
    return [_one(source, model, ask) for ask in pickle.loads(asks)]  # noqa: S301 - what the process above made


def _one(source: Path | ExchangedSimulator, model: Model, ask: SimulationRequest) -> SimulationOutcome:
    simulator = simulator_of(source) if isinstance(source, Path) else source
    place = str(source) if isinstance(source, Path) else source.said
    try:
        return simulated(simulator, model, ask)
    except FOREIGN as error:
        line = line_in(error, place) if isinstance(source, Path) else None
        where = f"{place}:{line}" if line else place
        what = f"the simulation failed: {in_words(error)}"
        raise CalibrationError(
            what, where=f"{where}, {told(model, ask)}", remedy="mend `simulate` for this input"
        ) from error
