"""Values with uncertainty, the run that a fact is about, and conversion to JSON."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TypeVar

_Kind = TypeVar("_Kind")


def of_facts(kind: type[_Kind], *facts: object, **further: object) -> _Kind:
    """Return a dataclass whose fields are the facts' attributes of the same name, of the first fact with each, or given."""
    names = [one.name for one in fields(kind) if one.name not in further]  # type: ignore[arg-type]
    held = {name: fact for name in names for fact in reversed(facts) if hasattr(fact, name)}
    return kind(**{name: getattr(fact, name) for name, fact in held.items()}, **further)


def picked(one: object, *names: str) -> dict[str, object]:
    """Return some fields of an object by name."""
    return {name: getattr(one, name) for name in names}


@dataclass(frozen=True)
class BeforeAfter:
    """A figure with the earlier model (before) and with all findings (after)."""

    before: float
    after: float


class NamedRun:
    """What has a run's test, direction and repeat."""

    test: str
    direction: str
    repeat: int

    @property
    def key(self) -> tuple[str, str, int]:
        """Return what tells the run from the others of its session."""
        return self.test, self.direction, self.repeat

    @property
    def label(self) -> str:
        """Return the name for messages and file, such as `a-ccw-1`."""
        return f"{self.test}-{self.direction}-{self.repeat}"


@dataclass(frozen=True)
class OfRun(NamedRun):
    """A fact about one run."""

    test: str
    direction: str
    repeat: int


@dataclass(frozen=True)
class OfRunInSession(NamedRun):
    """A fact about one run of one of several sessions."""

    session: str
    test: str
    direction: str
    repeat: int
