"""Values with uncertainty, and their conversion to JSON."""

from __future__ import annotations

from dataclasses import fields
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
