"""Propose meanings of a foreign table's columns from their names, for the user to confirm."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.files.formats.mapping import (
    ANGLE,
    DEVIATION,
    DIRECTION,
    IGNORED,
    LENGTH,
    MEANINGS,
    OF_RUNS,
    TIME,
    UNITS,
)
from dbbstation.text.written import words
from dbbstation.trace import columns
from dbbstation.trace.columns import ColumnKind

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

_WORDS = {
    TIME: words("time, t, zeit, elapsed, sec, seconds, temps, tempo, tiempo, tid, tijd, čas, czas, время, 时间, 時間"),
    ANGLE: words(
        "angle, theta, winkel, phi, angolo, ángulo, angulo, ângulo, hoek, vinkel, úhel, kąt, угол, 角度, 각도"
    ),
    DEVIATION: words(
        "deviation, dev, error, abweichung, fehler, écart, ecart, erreur, scostamento, deviazione, errore, "
        "desviación, desviacion, desvio, erro, afwijking, avvikelse, avvik, odchylka, odchyłka, отклонение, 偏差, "
        "誤差, 误差, 편차"
    ),
    LENGTH: words(
        "length, distance, radius, laenge, länge, abstand, longueur, distanza, lunghezza, longitud, comprimento, "
        "lengte, längd, lengde, délka, długość, длина, 长度, 長さ, 半径, 半徑, 길이"
    ),
    DIRECTION: words("richtung, dir, sens, direzione, dirección, direção"),
}
"""Words in names of columns by meaning, in several languages; a radius deviation is a deviation."""

_NO_READINGS = words(
    "nominal, nom, target, commanded, soll, sollwert, set, programmed, nominale, théorique, 目標, 設定"
)
"""Words in names of columns with nominal values, which are no readings."""

_UNIT_WORDS = {
    **dict.fromkeys(("µm", "um", "micron", "microns", "micrometer", "mikrometer"), "µm"),
    **dict.fromkeys(("mm", "millimeter", "millimetre"), "mm"),
    **dict.fromkeys(("in", "inch", "inches", "zoll"), "inch"),
    **dict.fromkeys(("mil", "thou"), "mil"),
    **dict.fromkeys(("µin", "uin", "µinch", "uinch"), "µinch"),
    **dict.fromkeys(("deg", "°", "degree", "degrees", "grad", "度", "deg."), "deg"),
    **dict.fromkeys(("rad", "radian", "radians"), "rad"),
    **dict.fromkeys(("s", "sec", "second", "seconds"), "s"),
    **dict.fromkeys(("ms", "msec"), "ms"),
    "m": "m",
    "min": "min",
    "turn": "turn",
}

_OWN = {columns.TIME: (TIME, "s"), columns.LENGTH: (LENGTH, "mm"), columns.THETA: (ANGLE, "deg")}
_OWN |= {
    name: (name, "degC" if column.kind is ColumnKind.TEMPERATURE else "A")
    for name, column in columns.COLUMNS.items()
    if column.kind in {ColumnKind.TEMPERATURE, ColumnKind.CURRENT}
}

EXPORTED = frozenset({"test", "direction", "repeat", columns.TIME, columns.THETA, columns.LENGTH})
"""Columns that identify a table of `dbbstation export`."""


@dataclass(frozen=True)
class Proposed:
    """A column's probable meaning."""

    means: str
    unit: str = ""

    @property
    def complete(self) -> bool:
        """Return whether the unit is known or not needed."""
        return self.means not in UNITS or bool(self.unit)


def proposed(names: Sequence[str], units: Mapping[str, str]) -> dict[str, Proposed]:
    """Return probable meanings by name, each once; unknown columns are ignored.

    Args:
        units: texts below the names, by name.
    """
    found: dict[str, Proposed] = {}
    for name in names:
        if name in _OWN:
            found[name] = Proposed(*_OWN[name])
        elif name in OF_RUNS or name == columns.STATUS:
            found[name] = Proposed(name)
    for name in names:
        taken = {one.means for one in found.values()}
        meaning = _meaning(name)
        if name in found or meaning is None or meaning in taken or (meaning == DEVIATION and LENGTH in taken):
            continue
        found[name] = Proposed(meaning, _unit(units.get(name, "") or name, meaning))
    if LENGTH in {one.means for one in found.values()}:
        found = {name: one for name, one in found.items() if one.means != DEVIATION}
    return {name: found.get(name, Proposed(IGNORED)) for name in names}


def stated(text: str) -> tuple[str, Proposed] | None:
    """Return the meaning in `NAME=MEANING` or `NAME=MEANING:UNIT`, or None."""
    name, has, meant = text.rpartition("=")
    meaning, _, unit = meant.partition(":")
    known = UNITS.get(meaning, {})
    spelled = next((one for one in known if _plain(one) == _plain(unit)), "") or _unit(f"[{unit}]", meaning)
    if not has or not name or meaning not in MEANINGS or (unit and not spelled) or (unit and not known):
        return None
    return name, Proposed(meaning, spelled)


def _meaning(name: str) -> str | None:
    parts = set(re.findall(r"[^\W\d_]+", re.sub(r"[\[(（].*", "", name).lower()))
    if not parts.isdisjoint(_NO_READINGS):
        return None
    return next((meaning for meaning, known in _WORDS.items() if not parts.isdisjoint(known)), None)


def _unit(text: str, meaning: str) -> str:
    bracket = re.search(r"[\[(（]\s*([^\])）]*?)\s*[\])）]", text)
    word = bracket[1] if bracket else re.split(r"[\s_,/]+", text.strip())[-1]
    unit = _UNIT_WORDS.get(_plain(word), "")
    return unit if unit in UNITS.get(meaning, {}) else ""


def _plain(text: str) -> str:
    return text.strip().lower().replace("μ", "µ").replace("μ", "µ")
