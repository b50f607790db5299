"""The result of `fleet`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from dbbstation.facts import picked
from dbbstation.facts.serialise import Absent
from dbbstation.results.frame import Framed

State = Literal["done", "up-to-date", "failed"]
"""State of a session: computed now; known from an earlier call with the same inputs, options and program; failed."""

Kind = Literal["parameter", "figure", "cause"]
"""Kind of a quantity: a parameter of the machine; a figure of a fit or of a circle; a parameter of an identified
cause."""


@dataclass(frozen=True)
class FleetValue:
    """One number of a machine.

    Attributes:
        logarithmic: whether ratios of a positive size are compared.
    """

    kind: Kind
    quantity: str
    unit: str
    value: float
    uncertainty: float | None = None
    of: str = ""
    logarithmic: bool = False

    @property
    def key(self) -> tuple[str, ...]:
        """Return the words that identify the value within a session."""
        return self.kind, self.quantity, self.of


@dataclass(frozen=True)
class FleetCause:
    """A cause found by a diagnosis.

    Attributes:
        probability: given the catalogue of causes; None if not computed.
    """

    name: str
    verdict: str
    probability: float | None


@dataclass(frozen=True)
class FleetFound:
    """Findings of one session."""

    values: tuple[FleetValue, ...]
    causes: tuple[FleetCause, ...]
    headline: str
    notes: tuple[str, ...]


@dataclass(frozen=True)
class FleetSession:
    """One session of a fleet.

    Attributes:
        session: its folder, relative to the folder in the command.
        machine: serial number or name, with the session if it counts apart; empty if unreadable.
        started: first run, ISO 8601; None if not noted.
        state: `done`, `up-to-date` or `failed`.
        compared: whether it is its machine's last session.
    """

    session: str
    machine: str
    started: str | None
    state: State
    problem: str
    files: tuple[str, ...]
    headline: str
    compared: bool
    notes: tuple[str, ...]
    values: tuple[FleetValue, ...]


@dataclass(frozen=True)
class Scored:
    """One quantity of one machine, compared with like machines.

    Attributes:
        usual: mean of like machines; None if unknown.
        scatter: standard deviation of like machines beyond uncertainties; None if unknown.
        score: standard normal for a like machine; None if unknown.
        smallest_seen: departure that would count as unlike; None if unknown.
        unlike: whether it differs, at the stated rate of false alarms.
    """

    machine: str
    session: str
    kind: Kind
    quantity: str
    of: str
    unit: str
    value: float
    uncertainty: float | None
    sisters: int
    usual: float | None
    scatter: float | None
    score: float | None
    smallest_seen: float | None
    unlike: bool

    @property
    def key(self) -> tuple[str, ...]:
        """Return the key of a session's value."""
        return self.session, self.kind, self.quantity, self.of


@dataclass(frozen=True)
class SharedCause:
    """A cause of several machines."""

    name: str
    found_in: tuple[str, ...]
    machines: int
    false_claims: float


@dataclass(frozen=True)
class FleetComparison:
    """Machines compared with one another.

    Attributes:
        false_alarms: probability of any marked value if all machines are alike.
    """

    false_alarms: float
    machines: int
    quantities: int
    scored: tuple[Scored, ...]
    causes: tuple[SharedCause, ...]
    notes: tuple[str, ...]

    @property
    def unlike(self) -> tuple[Scored, ...]:
        """Return the values that differ significantly, the greatest score first."""
        found = [one for one in self.scored if one.unlike]
        return tuple(sorted(found, key=lambda one: -abs(one.score or 0.0)))


@dataclass(frozen=True, kw_only=True, eq=False)
class FleetResult(Framed):
    """The same task on many sessions.

    Attributes:
        task: `calibrate`, `circles`, `diagnose` or `report`.
        comparison: None without comparable values.
    """

    task: str
    folder: str
    table: str
    page: str
    sessions: tuple[FleetSession, ...]
    notes: tuple[str, ...]
    comparison: Annotated[FleetComparison | None, Absent]

    @property
    def failed(self) -> tuple[FleetSession, ...]:
        """Return failed sessions."""
        return tuple(one for one in self.sessions if one.state == "failed")

    def rows(self) -> list[dict[str, object]]:
        """Return one row per value with its score; a session without values has one row."""
        scored = {} if self.comparison is None else {one.key: one for one in self.comparison.scored}
        return [
            _row(session, value, None if value is None else scored.get((session.session, *value.key)))
            for session in self.sessions
            for value in session.values or (None,)
        ]


_OF_SESSION = ("machine", "session", "started", "state", "problem", "headline")
_OF_VALUE = ("kind", "quantity", "of", "unit", "value")
_SCORE = ("sisters", "usual", "scatter", "score", "smallest_seen", "unlike")
TABLE = (*_OF_SESSION, *_OF_VALUE, "u", *_SCORE)
"""Columns of the table."""


def _row(session: FleetSession, value: FleetValue | None, one: Scored | None) -> dict[str, object]:
    row: dict[str, object] = dict.fromkeys(TABLE) | picked(session, *_OF_SESSION)
    if value is not None:
        row |= picked(value, *_OF_VALUE) | {"u": value.uncertainty}
    return row if one is None else row | picked(one, *_SCORE)


@dataclass(frozen=True)
class StoredFiles:
    """A stored result: its key and further files."""

    key: str
    files: tuple[str, ...]
