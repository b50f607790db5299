"""Changes of one quantity over the sessions of a machine."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.history.standardised import BASELINE, standardised

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.history.run_length import Chart
    from dbbstation.history.standardised import Standardised


class Verdict(StrEnum):
    """What a history says of one quantity."""

    STEADY = "steady"
    """No change beyond scatter and uncertainty."""
    STANDS_OUT = "stands out"
    """Single sessions lie beyond both, and the next ones do not."""
    CHANGED = "changed"
    """From some session on it is another."""
    CANNOT_TELL = "cannot tell"
    """Too few sessions, or no stated uncertainty."""


@dataclass(frozen=True)
class Event:
    """Something beyond scatter and uncertainty.

    Attributes:
        verdict: `STANDS_OUT` or `CHANGED`.
        since: number of the value from which it is so.
        found: number of the value that showed it.
        difference: values from `since` to `found` less the level before, as weighted mean.
        u_difference: its standard uncertainty, by the larger of stated uncertainty and scatter.
    """

    verdict: Verdict
    since: int
    found: int
    difference: float
    u_difference: float


@dataclass(frozen=True, eq=False)
class Watched:
    """One quantity over all sessions; arrays have shape (n,).

    Attributes:
        events: in time order.
        z: standard normal where nothing changes; NaN where a value was not held against others.
        high: CUSUM upwards, NaN as above.
        low: CUSUM downwards, not negative.
        level: level from a change to the next, the latest known one of each stretch.
        u_level: its standard uncertainty, by the larger of stated uncertainty and scatter.
        scatter: of the last stretch, in stated uncertainties; NaN where too few values.
        lacking: values that the last stretch needs until it is watched; 0 where it is.
    """

    events: tuple[Event, ...]
    z: NDArray[np.float64]
    high: NDArray[np.float64]
    low: NDArray[np.float64]
    level: NDArray[np.float64]
    u_level: NDArray[np.float64]
    scatter: float
    lacking: int

    @property
    def watched(self) -> int:
        """How many values were held against others."""
        return int(np.isfinite(self.z).sum())

    @property
    def verdict(self) -> Verdict:
        """What all of it says."""
        if not self.watched:
            return Verdict.CANNOT_TELL
        found = {event.verdict for event in self.events}
        return next((v for v in (Verdict.CHANGED, Verdict.STANDS_OUT) if v in found), Verdict.STEADY)


def watch(
    values: NDArray[np.float64],
    u: NDArray[np.float64],
    chart: Chart,
    coverage_factor: float,
    baseline: int = BASELINE,
) -> Watched:
    """Look for changes beyond scatter and beyond stated uncertainty.

    A change is reported where the chart signals and the difference is more than k u besides. After a change a new baseline begins
    with the next value: those that showed the change were chosen by it, and would make the new level look off. A single value
    beyond its limit counts for a change where the next one lies beyond on the same side; otherwise it stands out, and is left out of
    the level.

    Args:
        values: in time order, shape (n,).
        u: standard uncertainty of each, positive, shape (n,).
        chart: its limits.
        coverage_factor: k of U = k u.
        baseline: values before the first that is watched, after each change again.
    """
    count = len(values)
    z, high, low, level, u_level = (np.full(count, np.nan) for _ in range(5))
    events: list[Event] = []
    start, out = 0, list[int]()
    while True:
        at = np.array([k for k in range(start, count) if k not in out], dtype=np.intp)
        stretch = _Stretch(at, standardised(values[at], u[at], baseline), values[at], u[at], chart, coverage_factor)
        found = stretch.first_event()
        end = count if found is None else found.found + 1
        inside = at < end
        z[at[inside]], high[at[inside]], low[at[inside]] = (x[inside] for x in (stretch.of.z, *stretch.sums))
        if found is not None and found.verdict is Verdict.STANDS_OUT and not _goes_on(found, events, at):
            events.append(found)
            out.append(found.found)
            continue
        if found is not None and found.verdict is Verdict.STANDS_OUT:
            first = events.pop()
            found = stretch.change(first.since, found.found, also=(values[first.since], u[first.since]))
        stays = at[inside] if found is None else at[at < found.since]
        until = count if found is None else found.since
        level[start:until], u_level[start:until] = stretch.final(len(stays))
        if found is None:
            break
        events.append(found)
        start = found.found + 1
        level[found.since : start], u_level[found.since : start] = np.nan, np.nan
        if start >= count:
            at = at[:0]
            break
    left = len(at)
    scatter = float(_scatter(values[at], u[at]))
    return Watched(tuple(events), z, high, low, level, u_level, scatter, max(baseline - left, 0))


def _goes_on(found: Event, events: list[Event], at: NDArray[np.intp]) -> bool:
    """Whether the value before stood out as well, on the same side."""
    if not events or events[-1].verdict is not Verdict.STANDS_OUT or events[-1].found < at[0]:
        return False
    last = events[-1]
    return last.found == found.found - 1 and last.difference * found.difference > 0.0


def _scatter(values: NDArray[np.float64], u: NDArray[np.float64]) -> float:
    """Return the standard deviation of values in stated uncertainties; NaN for fewer than two."""
    if len(values) < 2:  # noqa: PLR2004 - one value does not scatter
        return np.nan
    mean = np.average(values, weights=1.0 / u**2)
    return float(np.sqrt(np.sum(((values - mean) / u) ** 2) / (len(values) - 1)))


@dataclass(frozen=True, eq=False)
class _Stretch:
    """Values from the beginning or a change on, without those that stand out.

    Attributes:
        at: their numbers.
        of: held against those before.
        values: themselves.
        u: their standard uncertainties.
        chart: its limits.
        coverage_factor: k of U = k u.
    """

    at: NDArray[np.intp]
    of: Standardised
    values: NDArray[np.float64]
    u: NDArray[np.float64]
    chart: Chart
    coverage_factor: float

    @property
    def sums(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """CUSUM upwards and downwards; NaN in the baseline."""
        return tuple(self._sum(side) for side in (1.0, -1.0))  # type: ignore[return-value]  # two of them

    def _sum(self, side: float) -> NDArray[np.float64]:
        out = np.full(len(self.at), np.nan)
        steps = np.cumsum(side * self.of.z[np.isfinite(self.of.z)] - self.chart.reference)
        out[np.isfinite(self.of.z)] = steps - np.minimum(np.minimum.accumulate(steps), 0.0)
        return out

    def first_event(self) -> Event | None:
        """Return the first value beyond a limit whose difference is beyond the stated uncertainty too."""
        sums = self.sums
        high, low = (np.nan_to_num(one) for one in sums)
        single = np.abs(np.nan_to_num(self.of.z)) > self.chart.single
        beyond = single | (np.maximum(high, low) > self.chart.interval)
        for k in np.flatnonzero(beyond):
            if single[k]:
                event = self._event(Verdict.STANDS_OUT, int(k), int(k))
            else:
                side = high if high[k] >= low[k] else low
                since = int(np.flatnonzero(side[:k] <= 0.0)[-1]) + 1  # the baseline's are zero
                event = self._event(Verdict.CHANGED, since, int(k))
            if abs(event.difference) > self.coverage_factor * self._stated(event):
                return event
        return None

    def change(self, since: int, found: int, also: tuple[float, float]) -> Event:
        """Return a change that two values standing out show, one of which is not in this stretch."""
        k = int(np.searchsorted(self.at, found))
        pair, u = np.array([also[0], self.values[k]]), np.array([also[1], self.u[k]])
        after, u_after = _mean(pair, u)
        before = float(self.of.level[k])
        spread = self._spread(k)
        u_both = spread * float(np.hypot(u_after, self.of.u_level[k]))
        return Event(Verdict.CHANGED, since, found, after - before, u_both)

    def final(self, count: int) -> tuple[float, float]:
        """Return the level of the first values and its standard uncertainty; NaN for none."""
        if not count:
            return np.nan, np.nan
        level, u_level = _mean(self.values[:count], self.u[:count])
        scatter = _scatter(self.values[:count], self.u[:count])
        return level, u_level * max(1.0, float(np.nan_to_num(scatter)))

    def _event(self, verdict: Verdict, since: int, k: int) -> Event:
        after, u_after = _mean(self.values[since : k + 1], self.u[since : k + 1])
        u_both = self._spread(since) * float(np.hypot(u_after, self.of.u_level[since]))
        return Event(verdict, int(self.at[since]), int(self.at[k]), after - float(self.of.level[since]), u_both)

    def _stated(self, event: Event) -> float:
        """Standard uncertainty of an event's difference by the stated ones alone."""
        since = int(np.searchsorted(self.at, event.since))
        return event.u_difference / self._spread(since)

    def _spread(self, k: int) -> float:
        return max(1.0, float(self.of.scatter[k]))


def _mean(values: NDArray[np.float64], u: NDArray[np.float64]) -> tuple[float, float]:
    """Return the weighted mean and its standard uncertainty by the stated ones."""
    weight = 1.0 / u**2
    return float(np.average(values, weights=weight)), float(1.0 / np.sqrt(weight.sum()))
