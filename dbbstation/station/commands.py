"""What a person, or a program in their place, tells the sequencer. Put into its queue from any thread."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from dbbstation.plan.circle import Direction


@dataclass(frozen=True)
class Start:
    """The ball stands, the bar is in: wait for the machine to feed in.

    Attributes:
        remounted: the holder was touched although the announcement did not ask for it, so this run gets a new mounting.
        after_s: readings up to this machine time belong to what was before, also where they are read later [s].
    """

    remounted: bool = False
    after_s: float = -math.inf


@dataclass(frozen=True)
class Accept:
    """The complete run counts; go on to the next.

    Attributes:
        reason: why, where something was found wrong with it; empty: what was found is kept.
    """

    reason: str = ""


@dataclass(frozen=True)
class Repeat:
    """The run does not count, neither when complete nor while it goes on: measure it again.

    Attributes:
        reason: kept with the recording; empty: what was found wrong with it, else that the operator wanted it.
    """

    reason: str = ""


@dataclass(frozen=True)
class Reject:
    """The run does not count; go on to the next. What lacks an accepted run is named at the end."""

    reason: str = ""


@dataclass(frozen=True)
class Skip:
    """Leave the announced run out for now."""


@dataclass(frozen=True)
class Quit:
    """Stop here; a run that goes on is kept as far as it came. The session can be continued later."""


@dataclass(frozen=True)
class GoTo:
    """Measure another test next, also one that was left out or has its runs already; then go on from there.

    Attributes:
        direction: sense of travel; None: whichever is left to do.
    """

    test: str
    direction: Direction | None = None


@dataclass(frozen=True)
class Judge:
    """Give a run another verdict, at any time after it was recorded: a wrong one is taken back so.

    Attributes:
        direction: sense of travel.
        repeat: of this test and direction, from 1.
        reason: why it does not; kept with the recording.
    """

    test: str
    direction: Direction
    repeat: int
    accepted: bool
    reason: str = "rejected by the operator"


@dataclass(frozen=True)
class AddNote:
    """Keep a remark or the temperature of the shop with the session; at any time.

    Attributes:
        text: the remark; empty for a temperature alone.
        ambient_temp_c: temperature of the shop now [degC]; None where it was not read.
    """

    text: str = ""
    ambient_temp_c: float | None = None


@dataclass(frozen=True)
class Pause:
    """Leave the machine alone for a while: nothing is waited for."""


@dataclass(frozen=True)
class Resume:
    """Go on after a pause."""


Command: TypeAlias = Start | Accept | Repeat | Reject | Skip | Quit | GoTo | Judge | AddNote | Pause | Resume
