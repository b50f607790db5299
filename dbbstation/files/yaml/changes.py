"""Differences of two plain documents, key by key, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, TypeGuard

from dbbstation.files.yaml.schema import dotted

if TYPE_CHECKING:
    from dbbstation.files.yaml.text import Location


def changes(before: object, after: object, at: Location = ()) -> list[str]:
    """Return changes, one text per key such as `base_joints_mm[0][1] is 12.2, was 12.0`.

    Args:
        before: lists whose entries all have a `name` are matched by it.
        at: place of both in their documents.
    """
    if isinstance(before, Mapping) and isinstance(after, Mapping):
        gone = [f"{dotted((*at, str(key)))} is gone" for key in before if key not in after]
        new = [f"{dotted((*at, str(key)))} is new" for key in after if key not in before]
        same = [key for key in before if key in after]
        return [*gone, *new, *(text for key in same for text in changes(before[key], after[key], (*at, str(key))))]
    if _is_list(before) and _is_list(after):
        named = _by_name(before), _by_name(after)
        if named[0] is not None and named[1] is not None:
            moved = list(named[0]) != list(named[1]) and set(named[0]) == set(named[1])
            return [*([f"{dotted(at)} has another order"] if moved else []), *changes(*named, at)]
        if len(before) != len(after):
            return [f"{dotted(at)} has {len(after)} values, had {len(before)}"]
        pairs = enumerate(zip(before, after, strict=True))
        return [text for index, (old, new) in pairs for text in changes(old, new, (*at, index))]
    return [] if before == after else [f"{dotted(at)} is {_shown(after)}, was {_shown(before)}"]


def _is_list(value: object) -> TypeGuard[Sequence[object]]:
    return isinstance(value, Sequence) and not isinstance(value, str)


def _by_name(entries: Sequence[object]) -> dict[str, object] | None:
    named: dict[str, object] = {
        str(entry["name"]): entry for entry in entries if isinstance(entry, Mapping) and "name" in entry
    }
    return named if len(named) == len(entries) else None


def _shown(value: object) -> str:
    if isinstance(value, Mapping) or _is_list(value):
        return "a list of values"
    return str(value)
