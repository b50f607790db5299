"""Sort names and runs as people count, and list the first ones."""

from __future__ import annotations

import re
from collections import defaultdict
from typing import TYPE_CHECKING, Protocol, TypeVar

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

_NUMBER = re.compile(r"(\d+)")


def natural(name: str) -> tuple[tuple[int, int, str], ...]:
    """Return a sort key: `w9` before `w10`."""
    parts = (part for part in _NUMBER.split(name) if part)
    return tuple((0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts)


def listed(names: Sequence[str], most: int, *, between: str = ", ") -> str:
    """Return the first names of a list as text, with the count of the others."""
    return between.join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


class Repeated(Protocol):
    """A run with its test, direction and repeat."""

    @property
    def test(self) -> str:
        """Return the test's name."""
        ...

    @property
    def direction(self) -> str:
        """Return the sense of travel."""
        ...

    @property
    def repeat(self) -> int:
        """Return the number of the run of this test and direction."""
        ...


Run = TypeVar("Run", bound=Repeated)


def repeats_in_order(runs: Iterable[Run]) -> tuple[Run, ...]:
    """Return runs in their order, with the repeats of a test and direction in numerical order."""
    given = tuple(runs)
    alike: dict[tuple[str, str], list[Run]] = defaultdict(list)
    for run in given:
        alike[run.test, run.direction].append(run)
    next_of = {key: iter(sorted(repeats, key=lambda run: run.repeat)) for key, repeats in alike.items()}
    return tuple(next(next_of[run.test, run.direction]) for run in given)
