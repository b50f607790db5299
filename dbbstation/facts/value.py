"""A number with its standard uncertainty and unit."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated

from pydantic import BeforeValidator, PlainSerializer

from dbbstation.facts.digits import to_its_place

OrUnknown = Annotated[
    float,
    BeforeValidator(lambda number: math.nan if number is None else number),
    PlainSerializer(lambda number: number if math.isfinite(number) else None, return_type=float | None),
]
"""A number that is nan or infinite if unknown, then null in JSON."""


def finite(number: float | None) -> float | None:
    """Return a number, or None if it is not finite."""
    return number if number is not None and math.isfinite(number) else None


@dataclass(frozen=True)
class Value:
    """A number with its standard uncertainty u [GUM] in one unit."""

    value: OrUnknown
    uncertainty: OrUnknown
    unit: str

    @property
    def is_known(self) -> bool:
        """Return whether its uncertainty is known."""
        return math.isfinite(self.uncertainty)

    @property
    def in_words(self) -> str:
        """Return the value with its standard uncertainty and unit, in words."""
        known = " ± ".join(to_its_place(self.value, self.uncertainty)) if self.is_known else f"{self.value:.4g}"
        return f"{known} {self.unit}".rstrip()

    def at_least(self, uncertainty: float) -> Value:
        """Return the value with its standard uncertainty raised to at least this one; NaN leaves it unchanged."""
        return replace(self, uncertainty=uncertainty) if uncertainty > self.uncertainty else self
