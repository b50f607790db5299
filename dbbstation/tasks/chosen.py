"""The chosen tests of a plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import StationError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


def chosen_of(plan: str, known: Iterable[str], tests: Sequence[str], exclude: Sequence[str]) -> list[str]:
    """Return the named tests in their order, or all tests, without the excluded ones.

    Raises:
        StationError: an unknown name, or no test is left.
    """
    names = list(known)
    unknown = [name for name in (*tests, *exclude) if name not in names]
    if unknown:
        raise StationError(
            f"the plan has no test {', '.join(unknown)}", where=plan, remedy=f"it has {', '.join(names)}"
        )
    chosen = [name for name in tests or names if name not in exclude]
    if not chosen:
        raise StationError("no test is left", where=plan, remedy="exclude fewer")
    return chosen
