"""Results that are computed once for each object."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

if TYPE_CHECKING:
    from collections.abc import Callable

Key = TypeVar("Key")
P = ParamSpec("P")
Result = TypeVar("Result")


def once_for_each(compute: Callable[Concatenate[Key, P], Result]) -> Callable[Concatenate[Key, P], Result]:
    """Cache the results of a function as long as its first argument lives; the others must be hashable."""
    kept: WeakKeyDictionary[Any, dict[tuple[object, ...], Result]] = WeakKeyDictionary()

    @functools.wraps(compute)
    def cached(first: Key, /, *args: P.args, **named: P.kwargs) -> Result:
        found = kept.setdefault(first, {})
        asked = (args, tuple(sorted(named.items())))
        if asked not in found:
            found[asked] = compute(first, *args, **named)
        return found[asked]

    return cached
