"""What every cause says of itself to people: those of a hexapod and those of a single drive alike."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Texts:
    """What a cause says of itself.

    Attributes:
        shows: how it shows in the recordings that it is looked for in.
        confirm: how to confirm it on the machine or the drive.
        equation: the equation, in words or symbols.
        origin: where the equation comes from.
    """

    what: str
    shows: str
    confirm: str
    cure: str
    equation: str
    origin: str
