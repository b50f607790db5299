"""Pair the runs of two sessions, at common angles but separate times and conditions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import zip_longest
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.grouped import grouped
from dbbstation.diagnosis.shapes import variables
from dbbstation.errors import TraceError
from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.harmonics import bands, basis
from dbbstation.inference.square_root import slices
from dbbstation.model.machine_model import MachineModel
from dbbstation.trace.recording import averaged, means

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.machine_model import BarReading
    from dbbstation.model.observation import Observation
    from dbbstation.plan.plan import Circle, Direction
    from dbbstation.sources.contract import Motion
    from dbbstation.trace.recording import RawCircle


SAME = 1e-6
"""Largest difference of equal bar lengths [mm] and angles [deg]."""

SAME_PLACE_MM = 0.5
"""Largest distance between centres of one circle, from two CMM sheets of one plate, or sheet and drawing."""


@dataclass(frozen=True, eq=False)
class Pair:
    """One run in both sessions.

    Attributes:
        number: of the run in its test and direction, from 1.
        a_mm: raw minus commanded length in A at sector middles from +X, shape (s,).
    """

    a: tuple[Observation, ...]
    b: tuple[Observation, ...]
    number: int
    a_mm: Floats
    b_mm: Floats

    @property
    def test(self) -> str:
        """Return the test's name."""
        return self.a[0].test

    @property
    def circle(self) -> Circle:
        """Return the circle commanded in A."""
        return self.a[0].raw.circle

    @property
    def direction(self) -> Direction:
        """Return the direction of travel."""
        return self.circle.direction

    @property
    def label(self) -> str:
        """Return the name for texts and tables."""
        return f"{self.test} {self.direction} {self.number}"

    @property
    def theta_deg(self) -> Floats:
        """Return sector middles from +X towards +Y, shape (s,) [deg]."""
        return (np.arange(len(self.a_mm), dtype=np.float64) + 0.5) * (FULL_TURN_DEG / len(self.a_mm))

    @property
    def difference_mm(self) -> Floats:
        """Return B minus A, interpolated over empty sectors, shape (s,) [mm]."""
        difference = self.b_mm - self.a_mm
        there = np.isfinite(difference)
        return np.interp(self.theta_deg, self.theta_deg[there], difference[there], period=FULL_TURN_DEG)


@dataclass(frozen=True)
class NotComparable:
    """A test that both sessions contain, but with different circles."""

    test: str
    text: str


@dataclass(frozen=True, eq=False)
class Matching:
    """Runs paired for comparison.

    Attributes:
        pairs: in session A's order.
        not_comparable: tests of equal name but different circles, with their differences.
        averaged: repeats that were averaged, with reasons.
    """

    pairs: tuple[Pair, ...]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]
    not_comparable: tuple[NotComparable, ...]
    averaged: tuple[str, ...]


def match(a: Sequence[Observation], b: Sequence[Observation]) -> Matching:
    """Match runs of a test and direction.

    Raises:
        TraceError: no runs match.
    """
    of_a, of_b = _by_run(a), _by_run(b)
    unlike = {key[0]: what for key in of_a if key in of_b and (what := _unlike(of_a[key] + of_b[key]))}
    common = [key for key in of_a if key in of_b and key[0] not in unlike]
    only_a = tuple(" ".join(key) for key in of_a if key not in of_b)
    only_b = tuple(" ".join(key) for key in of_b if key not in of_a)
    if not common:
        reasons = "; ".join(f"test {test}: {what}" for test, what in unlike.items())
        names = [", ".join(sorted({test for test, _ in runs})) for runs in (of_a, of_b)]
        raise TraceError(
            "the sessions have no run in common" + (f" ({reasons})" if reasons else ""),
            remedy=f"compare sessions of one plan: A has accepted runs of the tests {names[0]}, B of {names[1]}",
        )
    sparsest = min(len(o.raw) for key in common for o in of_a[key] + of_b[key])
    sectors = min(BOUNDS.common_angles, sparsest // BOUNDS.samples_per_sector)
    pairs: list[Pair] = []
    averaged: list[str] = []
    for key in common:
        one, other = of_a[key], of_b[key]
        sets = [([x], [y]) for x, y in zip(one, other, strict=False)]
        if len(one) != len(other):
            sets = [(one, other)]
            averaged.append(f"{' '.join(key)}: mean of {len(one)} against mean of {len(other)}")
        for number, (x, y) in enumerate(sets, start=1):
            pairs.append(Pair(tuple(x), tuple(y), number, _mean(x, sectors), _mean(y, sectors)))
    return Matching(tuple(pairs), only_a, only_b, tuple(NotComparable(*one) for one in unlike.items()), tuple(averaged))


@dataclass(frozen=True, eq=False)
class Sectors:
    """Averages samples of a turn at sector middles.

    Samples are shifted along the run's smooth curve before averaging, because 0.1 mm off centre changes 0.4 µm per
    quarter degree.

    Attributes:
        there: filled sectors, shape (q,).
        group: index of each sample's sector in `there`, shape (n,).
        moved: matrix from sector means to their change at the middles, shape (q, q).
    """

    count: int
    there: Integers
    group: Integers
    moved: Floats

    @classmethod
    def of(cls, theta_deg: Floats, count: int) -> Sectors:
        """Return sectors for samples at angles from +X, shape (n,)."""
        sector = np.minimum((theta_deg * (count / FULL_TURN_DEG)).astype(np.int64), count - 1)
        there, group = np.unique(sector, return_inverse=True)
        highest, _ = bands(len(there))
        curve = basis(np.radians(means(theta_deg, group)), highest)
        middle = basis(np.radians((there + 0.5) * (FULL_TURN_DEG / count)), highest)
        away = middle - means(basis(np.radians(theta_deg), highest), group)
        return cls(count, there, group, away @ np.linalg.pinv(curve))

    def at_middles(self, values: Floats) -> Floats:
        """Return values at sector middles, (count,) or (count, p), from samples, (n,) or (n, p); NaN for empty sectors."""
        found = np.full((self.count, *values.shape[1:]), np.nan)
        averages = means(values, self.group)
        found[self.there] = averages + self.moved @ averages
        return found


def at_common_angles(raw: RawCircle, sectors: int) -> Floats:
    """Return raw minus commanded length at sector middles, shape (sectors,) [mm]; NaN for empty sectors."""
    poses = raw.circle.poses(raw.theta_deg)
    deviation = raw.length_mm - np.linalg.norm(poses[:, :3] - np.array(raw.circle.ball_mm), axis=1)
    return Sectors.of(raw.theta_deg, sectors).at_middles(deviation)


def _mean(runs: Sequence[Observation], sectors: int) -> Floats:
    return np.mean([at_common_angles(run.raw, sectors) for run in runs], axis=0)


def _by_run(runs: Sequence[Observation]) -> dict[tuple[str, str], list[Observation]]:
    return grouped(((run.test, str(run.raw.circle.direction)), run) for run in runs)


def _unlike(runs: Sequence[Observation]) -> str:
    first = runs[0].raw.circle
    for circle in (run.raw.circle for run in runs[1:]):
        pairs = [
            ("bar length", "mm", (first.bar_mm,), (circle.bar_mm,), SAME),
            ("tilt", "degrees", first.tilt_deg, circle.tilt_deg, SAME),
            ("elevation", "degrees", (first.elevation_deg,), (circle.elevation_deg,), SAME),
            ("ball", "mm", first.ball_mm, circle.ball_mm, SAME_PLACE_MM),
            ("centre", "mm", first.centre_mm, circle.centre_mm, SAME_PLACE_MM),
        ]
        for name, unit, one, other, tolerance in pairs:
            if any(abs(x - y) > tolerance for x, y in zip_longest(one, other, fillvalue=np.inf)):
                return f"{name} {_text_of(one)} {unit} in A, {_text_of(other)} in B"
    return ""


def _text_of(values: Sequence[float]) -> str:
    return " ".join(f"{value:.10g}" for value in values)


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
    def motions(self) -> list[list[Motion]]:
        """Return motions of the runs of A and B."""
        return [[run.motion() for run in runs] for runs in self.runs]

    @cached_property
    def orders(self) -> tuple[Integers, ...]:
        """Return indices of each pair's rows among common angles."""
        return tuple(np.argsort(pair.b[0].raw.circle.phi_deg(pair.theta_deg)) for pair in self.pairs)

    @cached_property
    def readings(self) -> list[list[BarReading]]:
        """Return nominal readings along the paths of A and B."""
        model = MachineModel(self.machine)
        return [[model.bar(motion) for motion in motions] for motions in self.motions]

    @cached_property
    def variables(self) -> list[list[dict[str, Floats]]]:
        """Return variables along the paths of A and B."""
        return [[variables(motion, self.machine) for motion in motions] for motions in self.motions]

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
    def _sectors(self) -> list[list[Sectors]]:
        return [
            [Sectors.of(run.raw.theta_deg, len(order)) for run, order in zip(runs, self.orders, strict=True)]
            for runs in self.runs
        ]

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


def _thinned(run: Observation, pair: Pair) -> Observation:
    raw, most = run.raw, BOUNDS.samples_of_angle * len(pair.theta_deg)
    return run.with_samples(averaged(raw, most) if len(raw) > most else raw)
