"""Two sessions run by run: which recordings belong together, and their difference at common angles."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import zip_longest
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import TraceError
from dbbstation.inference.harmonics import bands, basis
from dbbstation.plan.circle import FULL_TURN_DEG
from dbbstation.trace.average import means

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.model.observation import Observation
    from dbbstation.plan.circle import Circle, Direction
    from dbbstation.trace.circle import RawCircle

SECTORS = 180
"""Common angles per turn at the most: every two degrees, so that 30 undulations per turn are well seen."""

PER_SECTOR = 2
"""Samples per sector that the shortest run must have."""

SAME_PLACE_MM = 0.5
"""Centres of one circle may lie so far apart: CMM sheets of one plate, or the sheet and the drawing of it."""

SAME_LENGTH_MM = 1e-6
SAME_ANGLE_DEG = 1e-6


@dataclass(frozen=True, eq=False)
class Pair:
    """One run as both sessions have it.

    Attributes:
        a: the run in session A; several where the sessions have different numbers of repeats, which are averaged.
        number: counts the pairs of one test and direction, from 1.
        a_mm: raw length less commanded length in A at the middles of equal sectors from +X, shape (s,) [mm].
    """

    a: tuple[Observation, ...]
    b: tuple[Observation, ...]
    number: int
    a_mm: NDArray[np.float64]
    b_mm: NDArray[np.float64]

    @property
    def test(self) -> str:
        """Name of the test."""
        return self.a[0].test

    @property
    def circle(self) -> Circle:
        """As commanded in session A."""
        return self.a[0].raw.circle

    @property
    def direction(self) -> Direction:
        """Sense of travel."""
        return self.circle.direction

    @property
    def label(self) -> str:
        """Name of the run in texts and tables."""
        return f"{self.test} {self.direction} {self.number}"

    @property
    def theta_deg(self) -> NDArray[np.float64]:
        """Middles of the sectors, from +X towards +Y, shape (s,) [deg]."""
        return (np.arange(len(self.a_mm), dtype=np.float64) + 0.5) * (FULL_TURN_DEG / len(self.a_mm))

    @property
    def difference_mm(self) -> NDArray[np.float64]:
        """B less A; straight across sectors in which one of them has no sample, shape (s,) [mm]."""
        difference = self.b_mm - self.a_mm
        there = np.isfinite(difference)
        return np.interp(self.theta_deg, self.theta_deg[there], difference[there], period=FULL_TURN_DEG)


@dataclass(frozen=True, eq=False)
class Matching:
    """Which runs were put side by side.

    Attributes:
        pairs: in the order of session A.
        not_comparable: tests of one name and different circles, and in what they differ.
        averaged: tests and directions whose repeats were averaged, and why.
    """

    pairs: tuple[Pair, ...]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]
    not_comparable: tuple[tuple[str, str], ...]
    averaged: tuple[str, ...]


def match(a: Sequence[Observation], b: Sequence[Observation]) -> Matching:
    """Put runs of one test and direction side by side.

    Where both sessions have as many repeats, they pair in the order of recording; otherwise the mean of all repeats
    in A is held against the mean of those in B.

    Raises:
        TraceError: nothing belongs together.
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
    sectors = common_sectors([o.raw for key in common for o in of_a[key] + of_b[key]])
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
    return Matching(tuple(pairs), only_a, only_b, tuple(unlike.items()), tuple(averaged))


def common_sectors(raws: Sequence[RawCircle]) -> int:
    """Sectors into which the run with the fewest samples can be cut."""
    return min(SECTORS, min(len(raw) for raw in raws) // PER_SECTOR)


@dataclass(frozen=True, eq=False)
class Sectors:
    """Takes samples of one turn to the middles of equal sectors.

    A sector's samples are averaged. They do not lie evenly about the sector's middle, nor alike in both sessions, and a
    circle that is 0.1 mm off its centre changes by 0.4 µm in a quarter of a degree. Every sample is therefore moved to
    the middle along the run's own smooth curve, which leaves its noise as it is.

    Attributes:
        there: those that have a sample, shape (q,).
        group: number of each sample's sector among these, shape (n,).
        moved: what averages of these sectors, shape (q,), change by on the way to the middles, shape (q, q).
    """

    count: int
    there: NDArray[np.int64]
    group: NDArray[np.int64]
    moved: NDArray[np.float64]

    @classmethod
    def of(cls, theta_deg: NDArray[np.float64], count: int) -> Sectors:
        """Sectors of samples at angles from +X, shape (n,)."""
        sector = np.minimum((theta_deg * (count / FULL_TURN_DEG)).astype(np.int64), count - 1)
        there, group = np.unique(sector, return_inverse=True)
        highest, _ = bands(len(there))
        curve = basis(np.radians(means(theta_deg, group)), highest)
        middle = basis(np.radians((there + 0.5) * (FULL_TURN_DEG / count)), highest)
        away = middle - means(basis(np.radians(theta_deg), highest), group)
        return cls(count, there, group, away @ np.linalg.pinv(curve))

    def at_middles(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of samples, shape (n,) or (n, p), in the middle of each sector, (count,) or (count, p); NaN without a sample."""
        found = np.full((self.count, *values.shape[1:]), np.nan)
        averages = means(values, self.group)
        found[self.there] = averages + self.moved @ averages
        return found


def at_common_angles(raw: RawCircle, sectors: int) -> NDArray[np.float64]:
    """Raw length less commanded length in the middle of each sector, shape (sectors,) [mm]; NaN without a sample."""
    poses = raw.circle.poses(raw.theta_deg)
    deviation = raw.length_mm - np.linalg.norm(poses[:, :3] - np.array(raw.circle.ball_mm), axis=1)
    return Sectors.of(raw.theta_deg, sectors).at_middles(deviation)


def _mean(runs: Sequence[Observation], sectors: int) -> NDArray[np.float64]:
    return np.asarray(np.mean([at_common_angles(run.raw, sectors) for run in runs], axis=0), dtype=np.float64)


def _by_run(runs: Sequence[Observation]) -> dict[tuple[str, str], list[Observation]]:
    """Runs by test and direction, in the order they were recorded."""
    found: dict[tuple[str, str], list[Observation]] = {}
    for run in runs:
        found.setdefault((run.test, str(run.raw.circle.direction)), []).append(run)
    return found


def _unlike(runs: Sequence[Observation]) -> str:
    """In what runs of one name are not one circle; empty where they are."""
    first = runs[0].raw.circle
    for circle in (run.raw.circle for run in runs[1:]):
        pairs = [
            ("bar length", "mm", (first.bar_mm,), (circle.bar_mm,), SAME_LENGTH_MM),
            ("tilt", "degrees", first.tilt_deg, circle.tilt_deg, SAME_ANGLE_DEG),
            ("elevation", "degrees", (first.elevation_deg,), (circle.elevation_deg,), SAME_ANGLE_DEG),
            ("ball", "mm", first.ball_mm, circle.ball_mm, SAME_PLACE_MM),
            ("centre", "mm", first.centre_mm, circle.centre_mm, SAME_PLACE_MM),
        ]
        for name, unit, one, other, tolerance in pairs:
            if any(abs(x - y) > tolerance for x, y in zip_longest(one, other, fillvalue=np.inf)):
                return f"{name} {_text_of(one)} {unit} in A, {_text_of(other)} in B"
    return ""


def _text_of(values: Sequence[float]) -> str:
    return " ".join(f"{value:.10g}" for value in values)
