"""Options of a command as one object."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from collections.abc import MutableMapping

_Options = TypeVar("_Options")


def taken_from(options: MutableMapping[str, Any], kind: type[_Options]) -> _Options:
    """Remove the options of one class from `options` and return them."""
    return kind(**{one.name: options.pop(one.name) for one in fields(kind)})  # type: ignore[arg-type]
