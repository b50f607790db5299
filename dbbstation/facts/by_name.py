"""A tuple whose items can also be found by name."""

from __future__ import annotations

import difflib
from typing import Any, SupportsIndex, TypeVar, get_args, overload

from pydantic_core import core_schema

_Item = TypeVar("_Item")


class ByName(tuple[_Item, ...]):
    """Items that have a `name`, in order: `items[0]`, or `items["gravity"]`."""

    __slots__ = ()

    @overload
    def __getitem__(self, key: SupportsIndex | str, /) -> _Item: ...
    @overload
    def __getitem__(self, key: slice, /) -> tuple[_Item, ...]: ...
    def __getitem__(self, key: SupportsIndex | str | slice, /) -> _Item | tuple[_Item, ...]:
        """Return an item; for an unknown name, raise KeyError with the nearest name."""
        if not isinstance(key, str):
            return super().__getitem__(key)
        names: list[str] = [one.name for one in self]  # type: ignore[attr-defined]
        if key not in names:
            near = difflib.get_close_matches(key, names, n=1)
            raise KeyError(f"{key!r} is not there; did you mean {near[0]!r}?" if near else f"{key!r}: not in {names}")
        return super().__getitem__(names.index(key))

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:  # noqa: ANN401 - as pydantic has it
        """Let pydantic treat it as a tuple."""
        kind: Any = tuple.__class_getitem__((get_args(source)[0], ...))
        return core_schema.no_info_after_validator_function(cls, handler.generate_schema(kind))
