"""Commands to the sequencer, queued from any thread."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from dbbstation.facts import OfRun

if TYPE_CHECKING:
    from dbbstation.plan.plan import Direction


@dataclass(frozen=True)
class Start:
    """Ball and bar are in place: wait for the feed-in.

    Attributes:
        remounted: the holder was touched although the program did not ask for it, so the run gets a new mounting.
        after_s: machine time before which readings do not count.
    """

    remounted: bool = False
    after_s: float = -math.inf


@dataclass(frozen=True)
class Accept:
    """Accept the complete run and go on.

    Attributes:
        reason: reason for accepting a finding; empty: the findings are kept.
        back: withdraw the doubted runs and measure them next.
        alone: withdraw an earlier run of the same test and direction.
    """

    reason: str = ""
    back: bool = False
    alone: bool = False


@dataclass(frozen=True)
class Repeat:
    """Discard this run and measure it again.

    Attributes:
        reason: empty: the finding, or without one the operator's wish.
    """

    reason: str = ""
    back: bool = False


@dataclass(frozen=True)
class Reject:
    """Reject the run and continue. The end of the sequence names tests without an accepted run."""

    reason: str = ""


@dataclass(frozen=True)
class Skip:
    """Skip the announced run for now."""


@dataclass(frozen=True)
class Quit:
    """Stop the sequence. A running recording is kept, and the session can be continued."""


@dataclass(frozen=True)
class GoTo:
    """Measure another test next, even a skipped or finished test; then continue from there.

    Attributes:
        direction: None: whichever is left.
    """

    test: str
    direction: Direction | None = None


@dataclass(frozen=True)
class Judge(OfRun):
    """Change the verdict on a recorded run at any time."""

    direction: Direction
    accepted: bool
    reason: str = "rejected by the operator"


@dataclass(frozen=True)
class AddNote:
    """Add a remark or the shop's temperature to the session at any time."""

    text: str = ""
    ambient_temp_c: float | None = None


@dataclass(frozen=True)
class Pause:
    """Pause."""


@dataclass(frozen=True)
class Resume:
    """Continue after a pause."""


Command: TypeAlias = Start | Accept | Repeat | Reject | Skip | Quit | GoTo | Judge | AddNote | Pause | Resume
