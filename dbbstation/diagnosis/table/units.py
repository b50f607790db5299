"""Units and kinds of columns, from names or statements."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from dbbstation.inference.channel import Kind


@dataclass(frozen=True)
class Meaning:
    """Meaning of a column.

    Attributes:
        period: of an angle's turn, else None.
        driven: True if it results from the simulation, as a motor's torque.
    """

    unit: str
    kind: Kind
    period: float | None = None
    driven: bool = False


PLAIN = Meaning("", Kind.ANY)

_LENGTHS = {"mm": "mm", "um": "µm", "µm": "µm", "nm": "nm", "cm": "cm", "m": "m", "inch": "inch"}
_TIMES = {
    "s": "s",
    "ms": "ms",
    "us": "µs",
    "min": "min",
    "h": "h",
    "d": "days",
    "day": "days",
    "days": "days",
    "years": "years",
    "yr": "years",
}
_FORCES = {"n": "N", "kn": "kN"}
_OTHERS = {
    unit.lower(): unit
    for unit in ("A", "V", "bar", "mbar", "Pa", "hPa", "kPa", "MPa", "kW", "J", "ppm", "W", "Hz", "kg", "g")
} | {"percent": "%"}
_TEMPERATURES = {"c": "degC", "degc": "degC", "celsius": "degC", "k": "K", "kelvin": "K"}

UNITS: dict[str, Meaning] = {
    **{name: Meaning(unit, Kind.LENGTH) for name, unit in _LENGTHS.items()},
    **{name: Meaning(unit, Kind.TIME) for name, unit in _TIMES.items()},
    **{name: Meaning(unit, Kind.FORCE) for name, unit in _FORCES.items()},
    **{name: Meaning(unit, Kind.TEMPERATURE) for name, unit in _TEMPERATURES.items()},
    **{name: Meaning(unit, Kind.ANY) for name, unit in _OTHERS.items()},
    **{
        f"{way}_{time}": Meaning(f"{unit}/{_TIMES[time]}", Kind.SPEED)
        for way, unit in (*_LENGTHS.items(), ("deg", "deg"), ("rad", "rad"))
        for time in ("s", "min")
    },
    "n_m": Meaning("N m", Kind.FORCE),
    "kg_m3": Meaning("kg/m³", Kind.ANY),
    "rpm": Meaning("rpm", Kind.SPEED),
    "deg": Meaning("deg", Kind.ANGLE, 360.0),
    "rad": Meaning("rad", Kind.ANGLE, 2.0 * math.pi),
    "turns": Meaning("turns", Kind.ANGLE, 1.0),
    "mrad": Meaning("mrad", Kind.ANGLE),
    "urad": Meaning("µrad", Kind.ANGLE),
    "arcsec": Meaning("arcsec", Kind.ANGLE),
}
"""Meanings by ending of a name, or by statement, in small letters."""

_AMOUNTS = {"l": "l", "ml": "ml", **{name: one.unit for name, one in UNITS.items() if one.kind is not Kind.TIME}}
"""Amounts in rates, as in `flow_l_min`, `speed_v_s`."""

_CLOCKS = {"t", "time", "timestamp", "clock", "elapsed", "date"}
_CALENDAR = {"year", "years", "day", "days", "jd", "mjd", "bjd"}
"""Names of calendar columns that give a row's time without a unit."""
_THERMOMETERS = ("temp", "temperature")
_WORDS = re.compile(r"[^a-z0-9µ%]+")


def meaning_of(name: str) -> Meaning:
    """Return the unit or kind that a column's name states, such as `travel_mm` or `angle_deg`; else `PLAIN`."""
    words = [word for word in _WORDS.split(name.lower()) if word]
    if (found := _unit_at_end(words)) is not None:
        return found
    if len(words) == 1 and words[0] in _CALENDAR:
        return Meaning("years" if words[0].startswith("year") else "days", Kind.TIME)
    if words and words[-1] in _CLOCKS:
        return Meaning("", Kind.TIME)
    if any(word.startswith(_THERMOMETERS) for word in words):
        return Meaning("", Kind.TEMPERATURE)
    return PLAIN


def _unit_at_end(words: list[str]) -> Meaning | None:
    for count in (2, 1):
        found = UNITS.get("_".join(words[-count:]))
        if len(words) <= count or found is None:
            continue
        if found.kind is not Kind.TIME or _CLOCKS & set(words[:-1]):
            return found
        rate = _AMOUNTS.get(words[-2]) if words[:-2] else None
        return Meaning(f"{rate}/{found.unit}" if rate else found.unit, Kind.ANY)  # otherwise a duration
    return None


def stated_meaning(text: str) -> Meaning | None:
    """Return the meaning of a stated unit or kind, such as `deg` or `time`; or None."""
    word = text.strip().lower().replace("/", "_").replace(" ", "_").replace("°", "deg")
    if word in UNITS:
        return UNITS[word]
    if word in set(Kind):
        return Meaning("", Kind(word))
    return None
