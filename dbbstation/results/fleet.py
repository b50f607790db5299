"""What the same task on many sessions found: the result of `fleet`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from dbbstation.facts.serialise import Absent
from dbbstation.results.frame import Framed

State = Literal["done", "up-to-date", "failed"]
"""Of a session: worked out now; known from an earlier call with the same inputs, options and program; failed."""

Kind = Literal["parameter", "figure", "cause"]
"""Of a quantity: a parameter of the machine; a figure of a fit or of a circle; a parameter of a cause that was found."""


@dataclass(frozen=True)
class FleetValue:
    """One number that a task found of a machine.

    Attributes:
        uncertainty: standard uncertainty; None where it is not known.
        of: circle that it was measured on, in words; empty where it is none of a circle.
        logarithmic: whether it is a positive size, of which ratios are compared.
    """

    kind: Kind
    quantity: str
    unit: str
    value: float
    uncertainty: float | None = None
    of: str = ""
    logarithmic: bool = False


@dataclass(frozen=True)
class FleetCause:
    """One cause as a diagnosis found it.

    Attributes:
        name: of the error source.
        verdict: one of the six words of docs/verdicts.md.
        probability: given the catalogue of causes; None where it was not worked out.
    """

    name: str
    verdict: str
    probability: float | None


@dataclass(frozen=True)
class FleetFound:
    """What a task found of one session.

    Attributes:
        values: numbers that can be compared with those of other machines.
        headline: in a few words.
    """

    values: tuple[FleetValue, ...]
    causes: tuple[FleetCause, ...]
    headline: str
    notes: tuple[str, ...]


@dataclass(frozen=True)
class FleetSession:
    """One session of a fleet.

    Attributes:
        session: its folder, from the folder that was named.
        machine: serial number, or the name in its machine file, with the session where each is a machine of its own; empty where
            the session cannot be read.
        started: start of its first run, ISO 8601; None where none is noted.
        state: `done`, `up-to-date` or `failed`.
        problem: why it failed; empty where it did not.
        files: what was written of it, within the folder of the results.
        headline: in a few words what was found.
        compared: whether the comparison of machines has it: the last session of each machine.
        values: that the task found.
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
    """One quantity of one machine, held against its sisters.

    Attributes:
        of: circle in words; empty for none.
        uncertainty: standard uncertainty; None where not known.
        usual: middle of those; None where nothing can be said.
        scatter: standard deviation of those, beyond their uncertainties; None likewise.
        score: standard normal where the machine is like its sisters; None likewise.
        smallest_seen: departure from the middle from which on it would count as unlike; None likewise.
        unlike: whether it is unlike its sisters, at the stated rate of false alarms.
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
        """By what a session's value is found."""
        return self.session, self.kind, self.quantity, self.of


@dataclass(frozen=True)
class SharedCause:
    """A cause that was found in some machines of a fleet.

    Attributes:
        name: of the error source.
        false_claims: how many of those in `found_in` are expected to be wrong, by the probabilities of the diagnoses.
    """

    name: str
    found_in: tuple[str, ...]
    machines: int
    false_claims: float


@dataclass(frozen=True)
class FleetComparison:
    """Machines held against one another.

    Attributes:
        false_alarms: probability that a fleet of like machines has any value marked as unlike.
        causes: that were found anywhere.
        notes: what was not compared, and why.
    """

    false_alarms: float
    machines: int
    quantities: int
    scored: tuple[Scored, ...]
    causes: tuple[SharedCause, ...]
    notes: tuple[str, ...]

    @property
    def unlike(self) -> tuple[Scored, ...]:
        """Values that are unlike, the greatest score first."""
        found = [one for one in self.scored if one.unlike]
        return tuple(sorted(found, key=lambda one: -abs(one.score or 0.0)))


@dataclass(frozen=True, kw_only=True, eq=False)
class FleetResult(Framed):
    """The same task on many sessions.

    Attributes:
        task: `calibrate`, `circles`, `diagnose` or `report`.
        page: file with a row for each machine.
        sessions: in the order of their names.
        notes: which sessions were counted as one machine, or each as its own, since they have no serial number.
        comparison: of the machines; None where the task has no values to compare.
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
        """Sessions that failed."""
        return tuple(one for one in self.sessions if one.state == "failed")

    def rows(self) -> list[dict[str, object]]:
        """Every value of every session, one row for each, with its score where it was compared; a session without values has one row."""
        scored = {} if self.comparison is None else {one.key: one for one in self.comparison.scored}
        return [
            dict(zip(TABLE, _row(session, value, scored), strict=True))
            for session in self.sessions
            for value in session.values or (None,)
        ]


TABLE = (
    "machine",
    "session",
    "started",
    "state",
    "problem",
    "headline",
    "kind",
    "quantity",
    "of",
    "unit",
    "value",
    "u",
    "sisters",
    "usual",
    "scatter",
    "score",
    "smallest_seen",
    "unlike",
)
"""Columns of the table."""


def _row(session: FleetSession, value: FleetValue | None, scored: Mapping[tuple[str, ...], Scored]) -> list[object]:
    about: list[object] = [
        session.machine,
        session.session,
        session.started,
        session.state,
        session.problem,
        session.headline,
    ]
    if value is None:
        return about + [None] * (len(TABLE) - len(about))
    about += [value.kind, value.quantity, value.of, value.unit, value.value, value.uncertainty]
    one = scored.get((session.session, value.kind, value.quantity, value.of))
    if one is None:
        return about + [None] * (len(TABLE) - len(about))
    return [*about, one.sisters, one.usual, one.scatter, one.score, one.smallest_seen, one.unlike]


@dataclass(frozen=True)
class StoredFiles:
    """Where a result is kept: its key, and further files of it."""

    key: str
    files: tuple[str, ...]
