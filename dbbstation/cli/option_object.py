"""Options of a command as one object, where several commands have them or there are many."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from collections.abc import MutableMapping

_Options = TypeVar("_Options")


def taken_from(options: MutableMapping[str, Any], kind: type[_Options]) -> _Options:
    """Take the options of one class out of all that a command was given.

    Args:
        options: by name; those that are taken are no longer in it.
        kind: a dataclass whose fields have the names of its options.
    """
    return kind(**{one.name: options.pop(one.name) for one in fields(kind)})  # type: ignore[arg-type]
