"""Find the run of a recording from words of the user or the file's name."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.files.formats.mapping import DIRECTION, REPEAT, TEST
from dbbstation.files.recordings.run_csv import count_in
from dbbstation.plan.plan import Direction

if TYPE_CHECKING:
    from collections.abc import Sequence

WORDS = {
    **dict.fromkeys(("ccw", "anticlockwise", "counterclockwise", "counter-clockwise", "+"), Direction.CCW),
    **dict.fromkeys(("cw", "clockwise", "-"), Direction.CW),
}
"""Words for directions."""


@dataclass(frozen=True)
class RunName:
    """The known parts of a run's name.

    Attributes:
        test: empty if not named.
        repeat: number; None: the next.
    """

    test: str = ""
    direction: Direction | None = None
    repeat: int | None = None


def named_by(pattern: str, stem: str) -> dict[str, str]:
    """Return the run in a file name by a pattern such as `{test}_{direction}`; empty without match."""
    parts = re.split(r"\{(test|direction|repeat)\}", pattern)
    fields = {
        TEST: r"(?P<test>[A-Za-z0-9][A-Za-z0-9.]*?)",
        DIRECTION: r"(?P<direction>[^\W\d_]+)",
        REPEAT: r"(?P<repeat>\d+)",
    }
    expression = "".join(fields[part] if k % 2 else re.escape(part) for k, part in enumerate(parts))
    try:
        found = re.fullmatch(expression, stem)
    except re.error:  # one field twice
        found = None
    return {} if found is None else found.groupdict()


def run_name(text: str, known: Sequence[str]) -> RunName | None:
    """Return the run of `a`, `a-ccw` or `a-ccw-2`, or None.

    Args:
        known: tests of the plan, which may have hyphens.
    """
    test = max((name for name in known if text == name or text.startswith(f"{name}-")), key=len, default=None)
    if test is None:
        return None
    direction, _, repeat = text.removeprefix(test).removeprefix("-").partition("-")
    if not direction:
        return RunName(test)
    if direction not in set(Direction) or (repeat and not count_in(repeat)):
        return None
    return RunName(test, Direction(direction), count_in(repeat))
