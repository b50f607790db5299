"""False alarms and delays of a history, by simulation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import stats

from dbbstation.history.run_length import REFERENCE, SINGLE_SHARE, STATES, Chart, chart_for, transitions
from dbbstation.history.standardised import BASELINE
from dbbstation.history.watch import watch

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import NDArray

COVERAGE_FACTOR = 2.0
SCATTERS = (0.5, 1.0, 1.5, 4.0)
"""How much sessions really scatter, in stated uncertainties."""

STEPS = (1.0, 1.5, 2.0, 3.0, 5.0, 10.0)
"""Sizes of steps [standard deviations of a session]."""

DRIFT = 0.05
"""Of a drift, per session [standard deviations]."""

BEFORE = (10, 20, 50, 200)
"""Sessions before a change."""

FEW = (2, 3, 5, 8, 10, 16)
"""Sessions of short histories: up to ten are decided by stated uncertainty, sixteen by the scatter that ten have shown."""

LATE_STEPS = (3.0, 5.0, 7.0, 10.0, 20.0)
"""Sizes of steps in the last of a few sessions [stated uncertainties]."""

WAIT = 104
"""Sessions after a change in which it is to be found: two years of weekly ones."""


def signalled_within(chart: Chart, means: Iterable[float]) -> NDArray[np.float64]:
    """Return the probability that the upward chart has signalled by each value, shape (n,)."""
    state = np.zeros(STATES)
    state[0] = 1.0
    within = []
    moves: dict[float, NDArray[np.float64]] = {}
    for mean in means:
        if mean not in moves:
            moves[mean] = transitions(chart, mean)
        state = state @ moves[mean]
        within.append(1.0 - state.sum())
    return np.array(within)


@dataclass(frozen=True)
class Size:
    """Size of a study.

    Attributes:
        tables: histories without change.
        false_alarms: per session, whole table.
        changes: histories per kind of change.
    """

    tables: int
    quantities: int
    sessions: int
    false_alarms: float
    changes: int
    seed: int


@dataclass(frozen=True)
class Way:
    """A way to watch.

    Attributes:
        single_share: false alarms by single sessions.
    """

    name: str
    reference: float = REFERENCE
    single_share: float = SINGLE_SHARE
    baseline: int = BASELINE


WAYS = (
    Way("as it is"),
    Way("k 0.25", reference=0.25),
    Way("k 1", reference=1.0),
    Way("no limit for single sessions", single_share=0.0),
    Way("baseline 5", baseline=5),
    Way("baseline 20", baseline=20),
)


def study(size: Size, progress: Callable[[int, int], None] = lambda _done, _of: None) -> dict[str, Any]:
    """Simulate; return shares and delays."""
    of = len(SCATTERS) + len(WAYS) + len(FEW)
    alarms, delays, few = [], [], []
    for done, scatter in enumerate(SCATTERS):
        progress(done, of)
        alarms.append(_false_alarms(size, scatter, np.random.default_rng([size.seed, int(10 * scatter)])))
    for done, way in enumerate(WAYS, start=len(SCATTERS)):
        progress(done, of)
        delays += _delays(size, way, np.random.default_rng(size.seed))
    for done, sessions in enumerate(FEW, start=len(SCATTERS) + len(WAYS)):
        progress(done, of)
        few.append(_few_sessions(size, sessions, np.random.default_rng([size.seed, sessions])))
    progress(of, of)
    return {
        "seed": size.seed,
        "tables": size.tables,
        "quantities": size.quantities,
        "sessions": size.sessions,
        "false_alarms_per_session": size.false_alarms,
        "false_alarms": alarms,
        "histories_per_change": size.changes,
        "delays": delays,
        "few_sessions": few,
    }


def _few_sessions(size: Size, sessions: int, rng: np.random.Generator) -> dict[str, Any]:
    """Return false alarms of short tables, and detections of a last step."""
    few = replace(size, sessions=sessions)
    chart = chart_for(size.false_alarms / size.quantities)
    found = {}
    for step in LATE_STEPS:
        values = rng.standard_normal((size.changes, sessions))
        values[:, -1] += step
        seen = [watch(row, np.ones(sessions), chart, COVERAGE_FACTOR).events for row in values]
        found[f"{step:g}"] = float(np.mean([any(event.found == sessions - 1 for event in events) for events in seen]))
    return {
        "sessions": sessions,
        "false_alarms": [_false_alarms(few, scatter, rng) for scatter in SCATTERS],
        "found_by_step": found,
    }


def _false_alarms(size: Size, scatter: float, rng: np.random.Generator) -> dict[str, Any]:
    chart = chart_for(size.false_alarms / size.quantities)
    found = 0
    for _ in range(size.tables):
        u = rng.uniform(0.5, 2.0, (size.quantities, size.sessions))
        values = scatter * u * rng.standard_normal(u.shape)
        found += any(watch(row, of, chart, COVERAGE_FACTOR).events for row, of in zip(values, u, strict=True))
    stated = stated_share(chart, size.quantities, size.sessions)
    low, high = stats.binomtest(found, size.tables).proportion_ci(0.95)
    return {
        "scatter_in_u": scatter,
        "stated": stated,
        "found": found / size.tables,
        "interval": [float(low), float(high)],
    }


def stated_share(chart: Chart, quantities: int, sessions: int) -> float:
    """Return the alarm share without change, by the Markov chain.

    Args:
        chart: of one quantity.
        sessions: the first has no comparison.
    """
    quiet = 1.0 - signalled_within(chart, [0.0] * (sessions - 1))[-1]
    return float(1.0 - quiet ** (2 * quantities))


def _delays(size: Size, way: Way, rng: np.random.Generator) -> list[dict[str, Any]]:
    chart = chart_for(size.false_alarms / size.quantities, way.reference, way.single_share)
    rows = []
    for before in BEFORE:
        kinds = {f"step of {step:g}": [step] * WAIT for step in STEPS}
        kinds[f"drift of {DRIFT:g} per session"] = [DRIFT * k for k in range(WAIT)]
        for kind, change in kinds.items():
            values = rng.standard_normal((size.changes, before + WAIT))
            values[:, before:] += change
            found = [_delay(row, before, chart, way.baseline) for row in values]
            delays = [delay for delay in found if delay is not None]
            seen = [delay for delay in delays if np.isfinite(delay)]
            rows.append(
                {
                    "way": way.name,
                    "change": kind,
                    "sessions_before": before,
                    "found": len(seen) / len(delays) if delays else None,
                    "median_delay": float(np.median(delays)) if len(seen) > len(delays) / 2 else None,
                }
            )
    return rows


def _delay(values: NDArray[np.float64], before: int, chart: Chart, baseline: int) -> float | None:
    """Return sessions until detection, infinite if never; None after an earlier alarm."""
    events = watch(values, np.ones(len(values)), chart, COVERAGE_FACTOR, baseline).events
    if not events:
        return float("inf")
    return None if events[0].found < before else float(events[0].found - before + 1)
