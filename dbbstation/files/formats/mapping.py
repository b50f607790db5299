"""`dbb-mapping/1`: the meaning of the columns of another program's recordings, written once for all files of a kind."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field

from dbbstation.facts.quantities import BarMm, Quantity, Text, sound
from dbbstation.files.atomic import write_text
from dbbstation.files.formats.number_language import number_language
from dbbstation.files.source_text import without_faults
from dbbstation.files.yaml.out import yaml_text
from dbbstation.files.yaml.schema import Rules, Schema, format_of, read_document, validate
from dbbstation.trace import columns
from dbbstation.trace.columns import ColumnKind

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.errors import Problem
    from dbbstation.files.formats.number_language import NumberLanguage

INCH_MM = 25.4
"""One inch [mm], exactly [ISO 31-1]."""

_LENGTHS = {"mm": 1.0, "µm": 1e-3, "m": 1e3, "inch": INCH_MM, "mil": 1e-3 * INCH_MM, "µinch": 1e-6 * INCH_MM}
_OFFSETS = {"degF": -160.0 / 9.0, "K": -273.15}

TIME, ANGLE, LENGTH, DEVIATION = "time", "angle", "length", "deviation"
TEST, DIRECTION, REPEAT, MOUNTING, STATE, STARTED = "test", "direction", "repeat", "mounting", "state", "started"
RUN = "run"
IGNORED = "ignored"

OF_RUNS = (TEST, DIRECTION, REPEAT, MOUNTING, STATE, STARTED, RUN)
"""Meanings of columns that identify a row's run; their cells are equal in all rows of the run."""

_OF_KIND = {
    ColumnKind.TEMPERATURE: {"degC": 1.0, "degF": 5.0 / 9.0, "K": 1.0},
    ColumnKind.CURRENT: {"A": 1.0, "mA": 1e-3},
}

UNITS: dict[str, dict[str, float]] = {
    TIME: {"s": 1.0, "ms": 1e-3, "min": 60.0},
    ANGLE: {"deg": 1.0, "rad": math.degrees(1.0), "turn": 360.0},
    LENGTH: _LENGTHS,
    DEVIATION: _LENGTHS,
    **{name: _OF_KIND[column.kind] for name, column in columns.COLUMNS.items() if column.kind in _OF_KIND},
}
"""Units of every meaning, with the factor to the unit of a run file."""

MEANINGS = (*UNITS, columns.STATUS, *OF_RUNS, IGNORED)
"""All meanings of columns."""


def in_run_units(meaning: str, unit: str) -> tuple[float, float]:
    """Return factor and offset to the unit of a run file: `value * factor + offset`."""
    return UNITS[meaning][unit], _OFFSETS.get(unit, 0.0)


def _no_meaning(text: str) -> str:
    return "" if text in MEANINGS else f"`{text}` is not a meaning of a column: {', '.join(MEANINGS)}"


def _no_zone(text: str) -> str:
    is_zone = re.fullmatch(r"[+-]\d{2}:\d{2}|UTC|[A-Za-z]+(?:/[A-Za-z_+-]+)+", text)
    return "" if is_zone else f"`{text}` is no time zone: write such as +01:00 or Europe/Berlin"


class ColumnSchema(Schema):
    """One column of the files."""

    means: Annotated[str, sound(_no_meaning)]
    """`time`, `angle`, `length` (between the ball centres), `deviation` (of the length from `zero_mm`, longer
    positive), `test`, `direction`, `repeat`, `mounting`, `state`, `started`, `run` (any text, equal in all rows of a
    run), `status`, a further column of run files such as `bar_temp_c`, or `ignored`."""
    unit: str | None = None
    """Unit of its numbers; absent if the column is a text, a count or ignored."""

    def _rules(self) -> Rules:
        known = UNITS.get(self.means, {})
        yield self.unit is not None and not known, f"a column that is `{self.means}` has no unit"
        said = "needs a unit" if self.unit is None else f"cannot have the unit `{self.unit}`"
        one = f"a column that is `{self.means}` {said}; give one of {', '.join(known)}"
        yield known and self.unit not in known, one


class AngleSchema(Schema):
    """Relation of the files' angles to the machine."""

    zero_deg: Annotated[float, Quantity("deg", 0, 720, signed=True)] | None = None
    """Machine angle, from +X towards +Y, at the files' angle 0; absent: the start of the plan's turn [deg]."""
    span_deg: Annotated[float, Quantity("deg", 300, 3_600)] | None = None
    """Range of a run's angles, if neither a turn nor the plan's path with its overshoot [deg]."""
    grows: Literal["ccw", "cw", "travel"]
    """Direction of growing numbers, seen from +Z: always `ccw`, always `cw`, or with the `travel` of the run."""


class MappingFile(Schema):
    """The meaning of the columns of another program's recordings."""

    format: Literal["dbb-mapping/1"]
    """Name and version of this format."""
    name: Text | None = None
    """Name of the program that wrote the files."""
    encoding: Literal["utf-8", "utf-16", "cp1252", "cp1250", "cp1251", "cp932", "gb18030"] = "utf-8"
    """Encoding of the files' text: Windows code pages are western, central European, Cyrillic and Japanese, GB 18030 is
    Chinese; a byte order mark in a file takes precedence."""
    separator: Literal["comma", "semicolon", "tab"] | None = None
    """Separator of columns; absent: a comma, or with decimal commas a semicolon."""
    decimal: Literal[".", ","] | None = None
    """Decimal sign; absent: a dot. If both are absent, the shop's settings apply, else the format is detected."""
    columns: Annotated[dict[str, ColumnSchema], Field(min_length=1)]
    """Meaning of each column by its name in the file; other columns are refused."""
    angle: AngleSchema | None = None
    """Relation of angles to the machine; required if a column is an angle."""
    trace: Literal["whole", "turn"] | None = None
    """Content of files with times and without angles: the `whole` run with feed-in and feed-out, or the full `turn`
    alone."""
    zero_mm: BarMm | None = None
    """Length of the bar at which the deviation is 0; required if a column is a deviation [mm]."""
    file_name: str | None = None
    """Pattern of file names without ending, such as `{test}_{direction}` or `{test}-{direction}-{repeat}`."""
    words: dict[str, Literal["ccw", "cw"]] = Field(default_factory=dict)
    """Words for directions in the files."""
    split: Literal["column", "gaps", "direction"] | None = None
    """Division of files with several runs: by a `column` that is `run`, by `gaps` (pauses, restarting times, empty
    lines), or by changes of the angles' `direction`; absent: by columns with test, direction and repeat, else a file is
    one run."""
    zone: Annotated[str, sound(_no_zone)] | None = None
    """Time zone of dates without one, such as `Europe/Berlin` or hours and minutes from UTC; absent: the importing
    computer's."""

    def _rules(self) -> Rules:
        meanings = [column.means for column in self.columns.values()]
        for one in sorted({m for m in meanings if m != IGNORED and meanings.count(m) > 1}):
            yield True, f"two columns are `{one}`; mark one of them as `ignored`"
        length, deviation, time, angle = (one in meanings for one in (LENGTH, DEVIATION, TIME, ANGLE))
        yield length and deviation, "length and deviation are the same quantity; mark one as `ignored`"
        yield not (length or deviation), "no column is `length` or `deviation`"
        yield not (time or angle), "no column is `time` or `angle`"
        must = "`angle` must state where 0 is and in which direction it grows"
        yield angle and self.angle is None, f"a column is an angle: {must}"
        must = "`zero_mm` must state the length of deviation 0"
        yield deviation and self.zero_mm is None, f"a column is a deviation: {must}"
        yield not angle and self.trace is None, "there are no angles: `trace` has to be `whole` or `turn`"
        both = "`split: column` and a column that is `run` belong together"
        yield (self.split == "column") != (RUN in meanings), both
        yield self.split == "direction" and not angle, "`split: direction` needs a column that is an angle"
        yield self.separator == "comma" and self.decimal == ",", "decimal sign and separator are both a comma"

    @property
    def numbers(self) -> NumberLanguage | None:
        """Return the number format; None if not stated."""
        return number_language(self.decimal, self.separator)

    def column(self, meaning: str) -> str | None:
        """Return the column with a meaning, or None."""
        return next((name for name, column in self.columns.items() if column.means == meaning), None)


def parse_mapping(path: Path, faults: list[Problem]) -> MappingFile | None:
    """Read a mapping; None with every fault added to `faults`."""
    document = read_document(path, MappingFile, faults)
    return None if document is None else validate(document, MappingFile)


def read_mapping(path: Path) -> MappingFile:
    """Read a mapping.

    Raises:
        InputError: every fault with its place.
    """
    return without_faults(parse_mapping, path)


def mapping_text(mapping: MappingFile) -> str:
    """Return the text of a mapping's file."""
    data = mapping.model_dump(exclude_none=True, exclude_defaults=True)
    return yaml_text({**data, "format": format_of(MappingFile)})


def write_mapping(path: Path, mapping: MappingFile) -> None:
    """Write a mapping.

    Raises:
        OutputError: the file exists, or it cannot be written.
    """
    write_text(path, mapping_text(mapping))
