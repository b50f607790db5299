"""Pulses and steps of a force, as levels between edges."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import betaincc, betaln, expit

from dbbstation.diagnosis.drive.findings import CausePart, Complement
from dbbstation.diagnosis.drive.fit import fit
from dbbstation.facts.value import Value
from dbbstation.inference.channel import NAMED_ODDS
from dbbstation.inference.forms import Stretches
from dbbstation.inference.levels import distinct_sizes, most_of_one_size, pooled

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.diagnosis.drive.explain import ExplainedDrive
    from dbbstation.diagnosis.drive.recordings import Recordings

APART = 4.0
"""Standard uncertainties by which levels must differ to be distinct: one in 15,000 by chance."""


@dataclass(frozen=True)
class Edges:
    """Edges of stretches.

    Attributes:
        at_turns: number of edges at starts, stops or reversals.
        share: share of time at these, strictly between 0 and 1.
    """

    count: int
    at_turns: int
    share: float

    @property
    def pushed(self) -> float:
        """Return the probability that edges are independent of motion, and not errors of a law at turns.

        Binomial likelihood, uniform prior; prior odds of a wrong law are one in twenty.
        """
        turns, others = self.at_turns + 1.0, self.count - self.at_turns + 1.0
        anywhere = self.at_turns * np.log(self.share) + (self.count - self.at_turns) * np.log1p(-self.share)
        above = max(float(betaincc(turns, others, self.share)), 1e-300)
        more_often = betaln(turns, others) + np.log(above) - np.log1p(-self.share)
        return float(expit(anywhere - more_often - NAMED_ODDS))


def edges_of(recordings: Recordings, parts: Sequence[CausePart]) -> Edges:
    """Return edges of stretches of time."""
    times = np.array([edge for part in parts for edge in part.t_s or ()])
    times = times[(times > recordings.time_s[0]) & (times < recordings.time_s[-1])]
    every = np.concatenate([one.turns[one.kept[0] : one.kept[-1]] for one in recordings.signals])
    # Rule of succession for events without samples [Laplace 1814].
    share = (float(every.sum()) + 1.0) / (len(every) + 2.0)
    return Edges(len(times), int(np.sum(_at_turns(recordings, times))), share)


def _at_turns(recordings: Recordings, times: Floats) -> Flags:
    """Return whether times, shape (t,), are at starts, stops or reversals."""
    found = np.zeros(len(times), dtype=bool)
    for rows, one in zip(recordings.blocks, recordings.signals, strict=True):
        begins, ends = recordings.time_s[rows.start], recordings.time_s[rows.stop - 1]
        own = (times >= begins) & (times <= ends)
        at = one.kept[0] + np.round((times[own] - begins) * one.rate_hz).astype(np.int64)
        found[own] = one.turns[np.clip(at, 0, len(one.t_s) - 1)]
    return found


def distinct_pushes(parts: Sequence[CausePart]) -> int:
    """Return the number of distinct sizes."""
    return distinct_sizes(_sizes_of(parts))


def equal_pushes(parts: Sequence[CausePart]) -> list[CausePart]:
    """Return the largest group of equal pushes, in order."""
    return [parts[k] for k in most_of_one_size(_sizes_of(parts))]


def _sizes_of(parts: Sequence[CausePart]) -> list[Value]:
    return [part.parameters["force_n"] for part in parts]


def complement_of(parts: Sequence[CausePart], first_s: float, last_s: float) -> Complement | None:
    """Return the inverse description of two or more equal pulses, or None."""
    equal = [part for part in equal_pushes(parts) if part.t_s is not None]
    if len(equal) < 2:  # noqa: PLR2004 - one pulse has no inverse
        return None
    size = pooled([part.parameters["force_n"] for part in equal])
    edges = [first_s, *(t for part in equal for t in part.t_s or ()), last_s]
    between = tuple((a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b > a)
    return Complement(Value(-size.value, size.uncertainty, size.unit), between, len(equal))


def pulse_parts(explained: ExplainedDrive, names: Sequence[str]) -> list[CausePart]:
    """Return stretches whose force differs from the surrounding force."""
    # Neighbouring levels share most of their uncertainty, so they need a common factor.
    settled, recordings = explained.settled, explained.drive.recordings
    after, apart, times = (
        fit(explained.drive, settled, settled.best.members),
        recordings.samples_apart_s,
        recordings.time_s,
    )
    columns, ends = [], []
    for name in names:
        rows, form = after.columns_of(name), settled.bank.patterns[name].form
        if isinstance(form, Stretches):
            columns.append(np.arange(rows.start, rows.stop))
            ends.append(np.column_stack([form.first, form.last])[: rows.stop - rows.start] * apart)
    own, within = np.concatenate(columns), np.clip(np.vstack(ends), times[0], times[-1])
    values, covariance = after.values[own], after.covariance[np.ix_(own, own)]

    def size(less: Floats) -> Value:
        return Value(float(less @ values), float(np.sqrt(max(float(less @ covariance @ less), 1e-300))), "N")

    def differ(one: Floats, other: Floats) -> bool:
        found = size(one - other)
        return abs(found.value) > APART * found.uncertainty

    def part(first: float, last: float, less: Floats) -> CausePart:
        return CausePart("", (first, last), {"force_n": size(less), "duration_s": Value(last - first, apart, "s")})

    edges = _distinct(np.concatenate([times[[0, -1]], within.ravel()]), apart)
    levels: list[tuple[float, float, Floats]] = []
    for first, last in pairwise(edges):
        middle = 0.5 * (first + last)
        level = ((within[:, 0] < middle) & (within[:, 1] > middle)).astype(np.float64)
        begins = first
        if levels and not differ(level, levels[-1][2]):
            begins, _, before = levels.pop()
            share = (last - first) / (last - begins)
            level = share * level + (1.0 - share) * before
        levels.append((begins, last, level))
    found = []
    while (peak := _peak(levels, values, differ)) is not None:
        found.append(part(*peak))
    levels.sort(key=lambda one: float(one[2] @ values))
    lasts = np.cumsum([last - first for first, last, _ in levels])
    usual = levels[int(np.searchsorted(lasts, 0.5 * lasts[-1]))][2]
    found += [part(first, last, level - usual) for first, last, level in levels if differ(level, usual)]
    return sorted(found, key=lambda one: one.t_s or ())


def _peak(
    levels: list[tuple[float, float, Floats]],
    values: Floats,
    differ: Callable[[Floats, Floats], bool],
) -> tuple[float, float, Floats] | None:
    """Merge the surroundings of the shortest significant level; return its times and its height over them, or None."""
    found: list[tuple[float, int]] = []
    for k in range(1, len(levels) - 1):
        before, own, behind = (level for *_, level in levels[k - 1 : k + 2])
        sizes = float((own - before) @ values), float((own - behind) @ values)
        if sizes[0] * sizes[1] > 0.0 and differ(own, before) and differ(own, behind):
            found.append((levels[k][1] - levels[k][0], k))
    if not found:
        return None
    _, k = min(found)
    (begins, _, before), (first, last, own), (_, ends, behind) = levels[k - 1 : k + 2]
    share = (first - begins) / (first - begins + ends - last)
    around = share * before + (1.0 - share) * behind
    levels[k - 1 : k + 2] = [(begins, ends, around)]
    return first, last, own - around


def _distinct(times: Floats, apart: float) -> list[float]:
    rising = np.sort(times)
    return [float(part.mean()) for part in np.split(rising, np.flatnonzero(np.diff(rising) > apart) + 1)]
