"""The result of `history`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from pydantic import Field

from dbbstation.facts.serialise import Kept
from dbbstation.history.watch import TrendEvent
from dbbstation.results.frame import Framed, picked


@dataclass(frozen=True)
class HistorySession:
    """One session of a history.

    Attributes:
        started: first accepted run, ISO 8601.
    """

    name: str
    started: str | None
    sha256: str

    @property
    def date(self) -> str:
        """Return the day of its start."""
        return (self.started or "")[:10]


@dataclass(frozen=True)
class ChangedQuantity:
    """Change of a quantity."""

    quantity: str
    difference: float
    u_difference: float
    unit: str


@dataclass(frozen=True)
class HistoryChange:
    """Changes of a machine since one session.

    Attributes:
        beside: other changes of that session, in words.
    """

    verdict: str
    since: HistorySession
    found: HistorySession
    beside: tuple[str, ...]
    quantities: tuple[ChangedQuantity, ...]


@dataclass(frozen=True)
class HistoryValue:
    """One quantity in one session, with the values of the chart; None if not watched.

    Attributes:
        z: standardised value, standard normal if nothing changed.
    """

    session: str
    started: str | None
    value: float
    u: float | None
    level: float | None
    z: float | None
    cusum_high: float | None
    cusum_low: float | None


@dataclass(frozen=True)
class QuantityHistory:
    """One quantity of one machine over its sessions.

    Attributes:
        figure: such as `G`, or a parameter.
        of: circle in words, or a parameter's error source.
        why_not: None if watched.
        limit: greatest size by the shop's tolerances.
        conformity: of the last value [ISO 14253-1].
        exceeded_sessions: number of sessions beyond the limit by more than U.
        scatter_in_u: scatter since the last change, in stated uncertainties.
        decided_by: `stated-uncertainty` or `control-chart`, or None.
    """

    quantity: str
    figure: str
    test: str | None
    direction: str | None
    of: str
    unit: str
    verdict: str
    why_not: str | None
    limit: float | None
    conformity: str | None
    exceeded_sessions: int | None
    level: float | None
    u_level: float | None
    scatter_in_u: float | None
    sessions_lacking: int | None
    decided_by: str | None
    watched_sessions: int
    events: tuple[TrendEvent[str], ...]
    values: tuple[HistoryValue, ...]


@dataclass(frozen=True)
class WatchLimits:
    """Limits of every quantity, in standard deviations."""

    reference: float
    decision_interval: float
    single_limit: float


@dataclass(frozen=True)
class MachineHistoryResult:
    """Sessions and quantities of one machine.

    Attributes:
        false_alarms_expected: number over this history if nothing changes.
    """

    machine: str
    sessions: tuple[HistorySession, ...]
    watched_quantities: int
    chart: WatchLimits | None
    false_alarms_expected: float
    verdicts: Mapping[str, int]
    changes: tuple[HistoryChange, ...]
    quantities: tuple[QuantityHistory, ...]


@dataclass(frozen=True)
class LeftOut:
    """An unusable session or model."""

    name: str
    problem: str


@dataclass(frozen=True, kw_only=True)
class HistoryResult(Framed):
    """Histories of the machines with sessions in a folder.

    Attributes:
        false_alarms_per_session: over all quantities of a machine.
        worked_out: sessions and models computed now, not read from the index.
        model_warnings: of each session's model, by session; `remarks` begin with them.
    """

    coverage_factor: float
    false_alarms_per_session: float
    baseline_sessions: int
    figures: Mapping[str, str]
    machines: tuple[MachineHistoryResult, ...]
    left_out: tuple[LeftOut, ...]
    remarks: Annotated[tuple[str, ...], Field(serialization_alias="notes")]
    worked_out: Annotated[int, Kept] = 0
    model_warnings: Annotated[Mapping[str, tuple[str, ...]], Kept] = field(default_factory=dict)

    def rows(self) -> list[dict[str, object]]:
        """Return one row per machine, quantity and session; None for missing values."""
        of_quantity = ("quantity", "figure", "test", "direction", "of", "unit")
        charted = ("level", "z", "cusum_high", "cusum_low")
        return [
            {
                "machine": machine.machine,
                **picked(one, *of_quantity),
                **picked(value, "session", "started", "value", "u"),
                "limit": one.limit,
                **picked(value, *charted),
                "event": next((event.verdict for event in one.events if event.found == value.session), None),
                "model_warning": "; ".join(self.model_warnings.get(value.session, ())) if one.test is None else None,
            }
            for machine in self.machines
            for one in machine.quantities
            for value in one.values
        ]
