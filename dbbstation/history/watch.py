"""Detect changes of one quantity over the sessions of a machine."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Generic, TypeVar

import numpy as np
from pydantic import computed_field

from dbbstation.facts.serialise import Kept
from dbbstation.history.standardised import BASELINE, ScatterRatio, standardised

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats
    from dbbstation.history.run_length import Chart
    from dbbstation.history.standardised import Standardised


class TrendVerdict(StrEnum):
    """Verdict of a history on one quantity."""

    STEADY = "steady"
    """No change beyond scatter and uncertainty."""
    STANDS_OUT = "stands out"
    """Single sessions are beyond both, but the following ones are not."""
    CHANGED = "changed"
    """The level differs from some session on."""
    CANNOT_TELL = "cannot tell"
    """No value could be compared: one session, or no stated uncertainty."""


DECIDED_BY = {True: "stated-uncertainty", False: "control-chart"}
"""Basis of a verdict: the stated uncertainties alone, or a control chart with the scatter of the sessions."""

_Session = TypeVar("_Session")


@dataclass(frozen=True)
class TrendEvent(Generic[_Session]):
    """A change or outlier beyond scatter and uncertainty; a session is its index, or its name in JSON.

    Attributes:
        verdict: `STANDS_OUT` or `CHANGED`.
        difference: mean from `since` to `found`, less the level before; once a baseline follows, new level less old level.
        by_stated: whether only stated uncertainties show it, since scatter is not known yet.
    """

    verdict: TrendVerdict
    since: _Session
    found: _Session
    difference: float
    u_difference: float
    by_stated: Annotated[bool, Kept] = False

    @computed_field  # type: ignore[prop-decorator]
    @property
    def decided_by(self) -> str:
        """Return the basis of the verdict."""
        return DECIDED_BY[self.by_stated]

    def named(self: TrendEvent[int], names: Sequence[str]) -> TrendEvent[str]:
        """Return the event with names of sessions."""
        return TrendEvent(
            self.verdict, names[self.since], names[self.found], self.difference, self.u_difference, self.by_stated
        )


@dataclass(frozen=True, eq=False)
class Watched:
    """One quantity over all sessions; arrays have shape (n,).

    Attributes:
        z: standard normal if nothing changed; NaN if not compared.
        high: CUSUM upwards; NaN if not compared.
        level: mean of all values between two changes.
        u_level: standard uncertainty by stated uncertainties or scatter, whichever is larger.
        scatter: scatter since the last change, in stated uncertainties; NaN for too few values.
        lacking: values needed before the next comparison: one just after a change, else zero; None if not watched.
        by_stated: whether the last comparison uses stated uncertainties alone.
    """

    events: tuple[TrendEvent[int], ...]
    z: Floats
    high: Floats
    low: Floats
    level: Floats
    u_level: Floats
    scatter: float
    lacking: int | None
    by_stated: bool = False

    @property
    def watched(self) -> int:
        """Return the number of compared values."""
        return int(np.isfinite(self.z).sum())

    @property
    def verdict(self) -> TrendVerdict:
        """Return the verdict on the whole history."""
        if not self.watched:
            return TrendVerdict.CANNOT_TELL
        found = {event.verdict for event in self.events}
        return next((v for v in (TrendVerdict.CHANGED, TrendVerdict.STANDS_OUT) if v in found), TrendVerdict.STEADY)


def not_watched(count: int) -> Watched:
    """Return the result for a quantity that no chart watches."""
    nothing = np.full(count, np.nan)
    return Watched((), nothing, nothing, nothing, nothing, nothing, np.nan, None)


def watch(
    values: Floats,
    u: Floats,
    chart: Chart,
    coverage_factor: float,
    baseline: int = BASELINE,
) -> Watched:
    """Find changes beyond scatter and beyond stated uncertainty.

    A change requires the chart's signal and a difference above k u. The new level is estimated from the next value on,
    because the signalling values were selected. A value beyond the single limit is an outlier and does not enter the
    level. If an event to the same side follows directly, both become one change.

    The chart uses the stated uncertainty until a baseline gives the scatter. If this scatter significantly exceeds the
    stated uncertainty, early values are compared with it too.
    """
    looked, scatter = _look(values, u, chart, coverage_factor, baseline, None)
    if not any(event.by_stated for event in looked.events):
        return looked
    # Fewer detected changes leave more scatter. Repeat until the detected changes no longer vary.
    taken = ScatterRatio()
    while scatter.more_than_stated and scatter.freedom > taken.freedom:
        taken = scatter
        looked, scatter = _look(values, u, chart, coverage_factor, baseline, taken)
    return looked


def _look(
    values: Floats,
    u: Floats,
    chart: Chart,
    coverage_factor: float,
    baseline: int,
    hindsight: ScatterRatio | None,
) -> tuple[Watched, ScatterRatio]:
    count = len(values)
    z, high, low, level, u_level = (np.full(count, np.nan) for _ in range(5))
    by_stated = np.zeros(count, dtype=bool)
    events: list[TrendEvent[int]] = []
    start, out, pooled = 0, list[int](), ScatterRatio()
    while True:
        at = np.array([k for k in range(start, count) if k not in out], dtype=np.intp)
        held = standardised(values[at], u[at], baseline, pooled, hindsight)
        stretch = _Stretch(at, held, values[at], u[at], chart, coverage_factor)
        found = stretch.first_event()
        end = count if found is None else found.found + 1
        inside = at < end
        z[at[inside]], high[at[inside]], low[at[inside]] = (x[inside] for x in (held.z, *stretch.sums))
        by_stated[at[inside]] = held.by_stated[inside]
        if found is not None:
            alike = _leads_to(found, events, start)
            if found.verdict is TrendVerdict.STANDS_OUT and not alike:
                events.append(found)
                out.append(found.found)
                continue
            if alike:
                events = [event for event in events if event not in alike]
                found = replace(
                    _change(min(found.since, alike[0].since), found.found, at, values, u), by_stated=found.by_stated
                )
        stays = at[inside] if found is None else at[at < found.since]
        pooled = pooled.with_residuals(held.residual[1 : len(stays)])
        until = count if found is None else found.since
        level[start:until], u_level[start:until] = stretch.final(len(stays))
        if start and len(stays) >= baseline:
            events = [_settled(e, level, u_level, start) if e.found == start - 1 else e for e in events]
        if found is None:
            break
        events.append(found)
        start = found.found + 1
        level[found.since : start], u_level[found.since : start] = np.nan, np.nan
        if start >= count:
            at = at[:0]
            break
    scatter = float(_scatter(values[at], u[at]))
    last = np.flatnonzero(np.isfinite(z))
    stated = bool(len(last)) and bool(by_stated[last[-1]])
    return Watched(tuple(events), z, high, low, level, u_level, scatter, max(1 - len(at), 0), stated), pooled


def _settled(event: TrendEvent[int], level: Floats, u_level: Floats, start: int) -> TrendEvent[int]:
    before = event.since - 1
    difference, u = float(level[start] - level[before]), float(np.hypot(u_level[start], u_level[before]))
    return replace(event, difference=difference, u_difference=u)


def _leads_to(found: TrendEvent[int], events: list[TrendEvent[int]], start: int) -> list[TrendEvent[int]]:
    """Return outliers that become part of the following event on the same side."""
    # If this event is an outlier itself, only an adjacent one counts.
    first = found.since - 1
    return [
        event
        for event in events
        if event.verdict is TrendVerdict.STANDS_OUT
        and event.found >= max(first, start)
        and event.difference * found.difference > 0.0
    ]


def _change(since: int, found: int, at: NDArray[np.intp], values: Floats, u: Floats) -> TrendEvent[int]:
    before, these = at[at < since], slice(since, found + 1)
    level, u_level = _mean(values[before], u[before])
    after, u_after = _mean(values[these], u[these])
    spread = max(1.0, _scatter(values[before], u[before]))
    return TrendEvent(TrendVerdict.CHANGED, since, found, after - level, spread * float(np.hypot(u_after, u_level)))


def _scatter(values: Floats, u: Floats) -> float:
    if len(values) < 2:  # noqa: PLR2004 - one value has no scatter
        return np.nan
    mean = np.average(values, weights=1.0 / u**2)
    return float(np.sqrt(np.sum(((values - mean) / u) ** 2) / (len(values) - 1)))


@dataclass(frozen=True, eq=False)
class _Stretch:
    at: NDArray[np.intp]
    of: Standardised
    values: Floats
    u: Floats
    chart: Chart
    coverage_factor: float

    @property
    def sums(self) -> tuple[Floats, Floats]:
        """Return CUSUM upwards and downwards; NaN for the first value."""
        return tuple(self._sum(side) for side in (1.0, -1.0))  # type: ignore[return-value]  # two of them

    def _sum(self, side: float) -> Floats:
        out = np.full(len(self.at), np.nan)
        steps = np.cumsum(side * self.of.z[np.isfinite(self.of.z)] - self.chart.reference)
        out[np.isfinite(self.of.z)] = steps - np.minimum(np.minimum.accumulate(steps), 0.0)
        return out

    def first_event(self) -> TrendEvent[int] | None:
        """Return the first event beyond a limit whose difference exceeds k times the stated uncertainty."""
        sums = self.sums
        high, low = (np.nan_to_num(one) for one in sums)
        single = np.abs(np.nan_to_num(self.of.z)) > self.chart.single
        beyond = single | (np.maximum(high, low) > self.chart.interval)
        for k in np.flatnonzero(beyond):
            if single[k]:
                event = self._event(TrendVerdict.STANDS_OUT, int(k), int(k))
            else:
                since = self._since(int(k), 1.0 if high[k] >= low[k] else -1.0)
                event = self._event(TrendVerdict.CHANGED, since, int(k))
            if abs(event.difference) > self.coverage_factor * self._stated(event):
                return event
        return None

    def _since(self, k: int, side: float) -> int:
        """Return the most probable start of the change signalled at k: it maximises sum / sqrt(length) [Hinkley 1970, Biometrika 57, 1]."""
        sums = np.nan_to_num(self._sum(side))
        first = int(np.flatnonzero(sums[:k] <= 0.0)[-1]) + 1  # the first value's sum is zero
        behind = np.cumsum(side * self.of.z[first : k + 1][::-1])[::-1]
        return first + int(np.argmax(behind / np.sqrt(np.arange(len(behind), 0, -1))))

    def final(self, count: int) -> tuple[float, float]:
        """Return mean and standard uncertainty of the first `count` values; NaN for none."""
        if not count:
            return np.nan, np.nan
        level, u_level = _mean(self.values[:count], self.u[:count])
        scatter = _scatter(self.values[:count], self.u[:count])
        return level, u_level * max(1.0, float(np.nan_to_num(scatter)))

    def _event(self, verdict: TrendVerdict, since: int, k: int) -> TrendEvent[int]:
        after, u_after = _mean(self.values[since : k + 1], self.u[since : k + 1])
        u_both = self._spread(since) * float(np.hypot(u_after, self.of.u_level[since]))
        difference = after - float(self.of.level[since])
        return TrendEvent(verdict, int(self.at[since]), int(self.at[k]), difference, u_both, bool(self.of.by_stated[k]))

    def _stated(self, event: TrendEvent[int]) -> float:
        since = int(np.searchsorted(self.at, event.since))
        return event.u_difference / self._spread(since)

    def _spread(self, k: int) -> float:
        return max(1.0, float(self.of.scatter[k]))


def _mean(values: Floats, u: Floats) -> tuple[float, float]:
    weight = 1.0 / u**2
    return float(np.average(values, weights=weight)), float(1.0 / np.sqrt(weight.sum()))
