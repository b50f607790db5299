"""Numbers with units for schemas; a plausible range detects a wrong unit."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator, Field, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

FULL_TURN_DEG = 360.0

USUAL_STROKE_MM = 10.0
"""Travel of a bar's gauge in each direction if neither instrument nor session states it [mm]. One bar measures circles
of 150 and 144 mm radius, so it is at least 6; up to 50 still distinguishes bars of 100 and 150 mm."""

_MISTAKEN: dict[str, tuple[tuple[str, float], ...]] = {
    "mm": (("m", 1e3), ("µm", 1e-3), ("inch", 25.4)),
    "µm": (("mm", 1e3), ("m", 1e6), ("nm", 1e-3)),
    "deg": (("rad", math.degrees(1.0)),),
    "mm/min": (("m/min", 1e3), ("mm/s", 60.0), ("m/s", 6e4)),
    "µm/(m K)": (("1/K", 1e6),),
    "kg": (("g", 1e-3), ("t", 1e3)),
}
"""Usual mistakes for each unit: another unit, and its factor to the right one."""

_KELVIN_AT_0_DEGC = 273.15


def complaint(what: str, kind: str = "wrong") -> PydanticCustomError:
    """Return the error of a value in a file, in words.

    Args:
        kind: `implausible` if its unit may be wrong.
    """
    return PydanticCustomError(kind, "{what}", {"what": what})


def sound(fault: Callable[[Any], str]) -> AfterValidator:
    """Return a check of a value in a file, from a function that returns what is wrong with it, or an empty text."""

    def checked(value: object) -> object:
        if what := fault(value):
            raise complaint(what)
        return value

    return AfterValidator(checked)


@dataclass(frozen=True)
class Quantity:
    """A number in a unit, with the range of plausible sizes.

    Attributes:
        least: smallest plausible value, absolute if `signed`.
        most: greatest plausible value, absolute if `signed`.
    """

    unit: str
    least: float
    most: float
    or_zero: bool = False
    signed: bool = False

    def fits(self, value: float) -> bool:
        """Return whether a value is plausible."""
        size = abs(value) if self.signed else value
        return self.least <= size <= self.most or (self.or_zero and value == 0)

    def check(self, value: float) -> float:
        """Return the value.

        Raises:
            PydanticCustomError: it is not plausible; names the range and the likely unit.
        """
        if self.fits(value):
            return value
        shown = f"{value:g} {self.unit}".strip()
        raise complaint(f"{shown} is not plausible, expected {self.range}{self.guess(value)}", "implausible")

    def guess(self, value: float) -> str:
        """Return the unit that an implausible value suggests, or an empty text."""
        for unit, factor in _MISTAKEN.get(self.unit, ()):
            if self.fits(value * factor):
                return f" (it looks like {unit})"
        if self.unit == "degC" and self.fits(value - _KELVIN_AT_0_DEGC):
            return " (it looks like kelvin)"
        return ""

    @property
    def range(self) -> str:
        """Return the plausible sizes as text."""
        sizes = f"{self.least:g} to {self.most:g}"
        if self.signed:
            sizes = f"±({sizes})" if self.least else f"-{self.most:g} to {self.most:g}"
        zero = "0 or " if self.or_zero and self.least > 0 else ""
        return f"{zero}{sizes} {self.unit}".strip()

    def __get_pydantic_core_schema__(self, source: type[Any], handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self.check, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        low = -self.most if self.signed else (min(0.0, self.least) if self.or_zero else self.least)
        return {**handler(schema), "unit": self.unit, "minimum": low, "maximum": self.most}


Coordinate = Annotated[float, Quantity("mm", 0, 10_000, signed=True)]
Point = tuple[Coordinate, Coordinate, Coordinate]
"""x, y, z [mm]."""


@dataclass(frozen=True)
class Reach:
    """Greatest plausible distance of a point from the origin; detects metres."""

    distance: Quantity

    def __call__(self, point: tuple[float, ...]) -> tuple[float, ...]:
        """Return the point; raise an error with its distance if it is too far."""
        distance = math.hypot(*point)
        if not self.distance.fits(distance):
            expected = f"{self.distance.least:g} to {self.distance.most:g} mm{self.distance.guess(distance)}"
            raise complaint(f"is {distance:g} mm from the origin, expected {expected}", "implausible")
        return point


@dataclass(frozen=True)
class Rising:
    """A pair of limits, the second above the first by a plausible amount."""

    span: Quantity

    def __call__(self, pair: tuple[float, float]) -> tuple[float, float]:
        """Return the pair; raise an error with its span if this is implausible."""
        low, high = pair
        if high < low:
            raise complaint("the lower limit must come first")
        if not self.span.fits(high - low):
            apart = f"{high - low:g} {self.span.unit} apart, which is not plausible{self.span.guess(high - low)}"
            raise complaint(f"the limits are {apart}", "implausible")
        return pair


_ANGLE = Annotated[float, Quantity("deg", 0, 360, signed=True)]
LimitsMm = Annotated[tuple[Coordinate, Coordinate], AfterValidator(Rising(Quantity("mm", 5, 20_000)))]
"""Least and greatest [mm]."""
LimitsDeg = Annotated[tuple[_ANGLE, _ANGLE], AfterValidator(Rising(Quantity("deg", 1, 720, or_zero=True)))]
"""Least and greatest [deg]."""
JointMm = Annotated[Point, AfterValidator(Reach(Quantity("mm", 20, 20_000)))]
"""A joint's centre: x, y, z [mm]."""
BarMm = Annotated[float, Quantity("mm", 20, 2_000)]
FormUm = Annotated[float, Quantity("µm", 0.001, 100, or_zero=True)]
Mass = Annotated[float, Quantity("kg", 0, 2_000)]
Text = Annotated[str, Field(min_length=1)]
Ordinal = Annotated[int, Field(ge=1)]
TemperatureDegc = Annotated[float, Quantity("degC", -30, 80)]
ExpansionUmMK = Annotated[float, Quantity("µm/(m K)", 0.01, 50, or_zero=True)]


def twice(values: Iterable[Any]) -> list[int]:
    """Return indices of repeated values; mappings are not compared."""
    seen: set[Any] = set()
    again = []
    for index, value in enumerate(values):
        try:
            hash(value)
        except TypeError:
            continue
        if value in seen:
            again.append(index)
        seen.add(value)
    return again
