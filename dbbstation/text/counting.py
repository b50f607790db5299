"""Names and runs in the order in which people count."""

from __future__ import annotations

import re
from collections import defaultdict
from typing import TYPE_CHECKING, Protocol, TypeVar

if TYPE_CHECKING:
    from collections.abc import Iterable

_NUMBER = re.compile(r"(\d+)")


def natural(name: str) -> tuple[tuple[int, int, str], ...]:
    """Return a key that sorts names with numbers as people count: `w9` before `w10`."""
    parts = (part for part in _NUMBER.split(name) if part)
    return tuple((0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts)


class Repeated(Protocol):
    """One of the runs of a test and direction."""

    @property
    def test(self) -> str:
        """Name of the test."""
        ...

    @property
    def direction(self) -> str:
        """Sense of travel."""
        ...

    @property
    def repeat(self) -> int:
        """Counts the runs of this test and direction."""
        ...


Run = TypeVar("Run", bound=Repeated)


def repeats_in_order(runs: Iterable[Run]) -> tuple[Run, ...]:
    """Return runs in their order, but the repeats of a test and direction as they are counted, at the places that these have.

    A list of files that was sorted by name has `a-ccw-10` before `a-ccw-2`.
    """
    given = tuple(runs)
    alike: dict[tuple[str, str], list[Run]] = defaultdict(list)
    for run in given:
        alike[run.test, run.direction].append(run)
    next_of = {key: iter(sorted(repeats, key=lambda run: run.repeat)) for key, repeats in alike.items()}
    return tuple(next(next_of[run.test, run.direction]) for run in given)
