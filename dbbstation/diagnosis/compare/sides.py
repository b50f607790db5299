"""Both sessions with equal circles and angles, but separate times and conditions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.compare.pairs import Sectors
from dbbstation.inference.blocks import slices
from dbbstation.inference.bounds import BOUNDS
from dbbstation.model.machine_model import MachineModel
from dbbstation.trace.recording import averaged

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.diagnosis.compare.pairs import Pair
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.machine_model import BarReading
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource, Motion


@dataclass(frozen=True, eq=False)
class Sides:
    """Rows are ordered by pair, then B's travel; motions keep their own samples.

    Attributes:
        runs: A's and B's run per pair; the first run of averaged repeats.
    """

    machine: Machine
    pairs: tuple[Pair, ...]
    runs: tuple[tuple[Observation, ...], tuple[Observation, ...]]

    @classmethod
    def of(cls, machine: Machine, pairs: Sequence[Pair]) -> Sides:
        """Return sides for paired runs."""
        a = tuple(_thinned(pair.a[0], pair) for pair in pairs)
        b = tuple(_thinned(pair.b[0], pair) for pair in pairs)
        return cls(machine, tuple(pairs), (a, b))

    @cached_property
    def motions(self) -> tuple[tuple[Motion, ...], tuple[Motion, ...]]:
        """Return motions of these runs."""
        a, b = ([run.motion() for run in runs] for runs in self.runs)
        return tuple(a), tuple(b)

    @cached_property
    def orders(self) -> tuple[Integers, ...]:
        """Return indices of each pair's rows among common angles."""
        return tuple(np.argsort(pair.b[0].raw.circle.phi_deg(pair.theta_deg)) for pair in self.pairs)

    @cached_property
    def readings(self) -> tuple[tuple[BarReading, ...], tuple[BarReading, ...]]:
        """Return nominal readings along the paths of A and B."""
        model = MachineModel(self.machine)
        a, b = ([model.bar(motion) for motion in motions] for motions in self.motions)
        return tuple(a), tuple(b)

    @cached_property
    def blocks(self) -> tuple[slice, ...]:
        """Return rows of each pair."""
        return tuple(slices(map(len, self.orders)))

    def rows(self, values_of: Callable[[Pair], Floats]) -> Floats:
        """Return values at common angles as rows, shape (n,)."""
        return np.concatenate([values_of(pair)[order] for pair, order in zip(self.pairs, self.orders, strict=True)])

    def averaged(self, side: int, values: Sequence[Floats]) -> Floats:
        """Return values along one session's motions as rows, shape (n, ...)."""
        found = []
        for sectors, order, one in zip(self._sectors[side], self.orders, values, strict=True):
            middles = sectors.at_middles(one.reshape(len(one), -1))
            # A sector without samples has the previous sector's value.
            last = np.maximum(np.searchsorted(sectors.there, order, side="right") - 1, 0)
            found.append(middles[sectors.there[last]].reshape(len(order), *one.shape[1:]))
        return np.concatenate(found)

    @cached_property
    def _sectors(self) -> tuple[list[Sectors], list[Sectors]]:
        a, b = (
            [Sectors.of(run.raw.theta_deg, len(order)) for run, order in zip(runs, self.orders, strict=True)]
            for runs in self.runs
        )
        return a, b

    def each_row(self, values: Sequence[float]) -> Floats:
        """Return one value per pair as rows, shape (n,)."""
        return np.repeat(np.array(values, dtype=np.float64), [len(order) for order in self.orders])

    def by_angle(self, rows: Floats) -> list[Floats]:
        """Return rows by pair at common angles, shape (s,) each."""
        found = []
        for order, block in zip(self.orders, self.blocks, strict=True):
            values = np.empty(len(order))
            values[order] = rows[block]
            found.append(values)
        return found

    def groups(self, source: ErrorSource) -> Integers:
        """Return each pair's group of shared values in both sessions, shape (r,)."""
        names = [(source.shared_by(one), source.shared_by(other)) for one, other in zip(*self.motions, strict=True)]
        order = list(dict.fromkeys(names))
        return np.array([order.index(name) for name in names], dtype=np.int64)


def _thinned(run: Observation, pair: Pair) -> Observation:
    raw, most = run.raw, BOUNDS.samples_of_angle * len(pair.theta_deg)
    return run.with_samples(averaged(raw, most) if len(raw) > most else raw)
