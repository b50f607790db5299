"""Options for the meaning of other programs' columns, and the resulting mapping."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import click

from dbbstation.cli.instrument_options import ZERO_MM
from dbbstation.cli.output import say
from dbbstation.cli.shop import shop_settings
from dbbstation.errors import InputError, read_each
from dbbstation.files.formats.number_language import SEPARATORS, number_language
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from dbbstation.cli.asking import Asker
    from dbbstation.files.formats.mapping import MappingFile
    from dbbstation.files.formats.number_language import NumberLanguage
    from dbbstation.files.recordings.foreign_csv import ForeignTable
    from dbbstation.tasks.importing.proposal import Proposed


def shops_numbers() -> NumberLanguage | None:
    """Return the number format of the shop's settings, with a note; None if not set.

    This is for commands in which a file overrides the settings.
    """
    values = shop_settings().values
    found = {key: values[name] for key in ("decimal", "separator") if (name := f"numbers.{key}") in values}
    if not found:
        return None
    texts = ", ".join(f"--{key} {setting.value}" for key, setting in found.items())
    say(f"settings: {texts} (from {next(iter(found.values())).file})")
    return number_language(*(str(found[key].value) if key in found else None for key in ("decimal", "separator")))


@dataclass(frozen=True, kw_only=True)
class AsWritten:
    """Options for the format of tables; None if not given."""

    decimal: Annotated[Literal[".", ","] | None, Option(o.DECIMAL)] = None
    separator: Annotated[
        Literal["comma", "semicolon", "tab", ",", ";", "\t"] | None,
        Option(o.SEPARATOR, metavar="[comma|semicolon|tab]"),
    ] = None
    encoding: Annotated[
        Literal["utf-8", "utf-16", "cp1252", "cp1250", "cp1251", "cp932", "gb18030"] | None,
        Option("Encoding of the files  [default: utf-8; detected for sheets]."),
    ] = None


@dataclass(frozen=True, kw_only=True)
class MappingOptions(AsWritten):
    """Options for the meaning of columns; None or empty if not given."""

    mapping: Annotated[
        Path | None,
        Option("File with the meaning of the columns: read if it exists, else written for the next time.", kind="file"),
    ] = None
    columns: Annotated[
        tuple[str, ...],
        Option(
            o.COLUMNS,
            metavar="NAME=MEANING:UNIT",
            whole=True,
        ),
    ] = ()
    angle_zero_deg: Annotated[
        float | None,
        Option("Machine angle at angle 0 of the files [deg], counted from +X to +Y.", least=-720.0, most=720.0),
    ] = None
    angle_grows: Annotated[
        Literal["ccw", "cw", "travel"] | None, Option("Direction in which the files' angles increase, seen from +Z.")
    ] = None
    angle_span_deg: Annotated[
        float | None,
        Option(
            "Range of a run's angles [deg], if it is neither one turn nor the plan's path. The import uses one turn.",
            least=300.0,
            most=3600.0,
        ),
    ] = None
    trace: Annotated[
        Literal["whole", "turn"] | None,
        Option("Content of files without angles: the whole run with feed-in and feed-out, or the full turn alone."),
    ] = None
    split: Annotated[
        Literal["gaps", "direction"] | None,
        Option(
            "How runs in one file are separated: by gaps (pauses, restarting times, empty lines), or by a reversal of the angles."
        ),
    ] = None
    zone: Annotated[
        str | None,
        Option("Time zone of dates without one, such as +01:00  [default: this computer's].", metavar="ZONE"),
    ] = None
    zero_mm: Annotated[float | None, ZERO_MM] = None
    file_name: Annotated[
        str | None, Option("Pattern of the file names, such as '{test}_{direction}'.", metavar="PATTERN")
    ] = None

    @property
    def kept(self) -> Path | None:
        """Return the mapping's file, or None."""
        return self.mapping if self.mapping is not None and self.mapping.exists() else None

    @property
    def said(self) -> list[str]:
        """Return the given options that a mapping also states."""
        given = [one.name for one in fields(self) if getattr(self, one.name) not in (None, ())]
        return [f"--{name.replace('_', '-')}" for name in given if name != "mapping"]


def read_tables(files: Sequence[Path], options: MappingOptions) -> dict[Path, ForeignTable]:
    """Read all files with the number format of the mapping, else of options, else of settings.

    If none states it, and for this program's own tables, the format is detected.

    Raises:
        InputError: every fault of every file.
        click.UsageError: an option repeats a fact of the mapping.
    """
    from dbbstation.files.formats.mapping import read_mapping

    decimal, separator = options.decimal, options.separator
    language = number_language(decimal, separator)
    encoding = options.encoding or "utf-8"
    kept = options.kept
    if kept is not None:
        if options.said:
            also = ", ".join(options.said)
            raise click.UsageError(f"{options.mapping} states the meaning of columns: edit it, or leave out {also}")
        mapping = read_mapping(kept)
        language, encoding = mapping.numbers, mapping.encoding
    shops = shops_numbers() if language is None else None
    return dict(zip(files, read_each(lambda path: _read(path, language, shops, encoding), files), strict=True))


def _read(path: Path, stated: NumberLanguage | None, shops: NumberLanguage | None, encoding: str) -> ForeignTable:
    from dbbstation.files.recordings.foreign_csv import read_foreign
    from dbbstation.tasks.importing.proposal import EXPORTED

    if shops is not None:
        with suppress(InputError):  # what is wrong with it is said as the shop reads it
            looked = read_foreign(path, None, encoding)
            if set(looked.table.names) >= EXPORTED:
                return looked
    return read_foreign(path, stated or shops, encoding)


def chosen_mapping(tables: Sequence[ForeignTable], options: MappingOptions, asker: Asker) -> Callable[[], MappingFile]:
    """Return a function that gives the mapping after all answers: from its file, or from names, options and answers."""
    from dbbstation.files.formats.mapping import ANGLE, DEVIATION, IGNORED, LENGTH, UNITS, read_mapping
    from dbbstation.tasks.importing.proposal import EXPORTED, Proposed

    kept = options.kept
    if kept is not None:
        return lambda: read_mapping(kept)
    table = tables[0]
    columns = _columns(table, options.columns)
    for name, one in columns.items():
        if not one.complete:
            units = list(UNITS[one.means])
            unit = asker.text(
                f"unit of the column {name}, taken for {one.means}", f"--columns '{name}={one.means}:UNIT'", units
            )
            columns[name] = Proposed(one.means, unit)
    means = {one.means for one in columns.values()}
    unknown = ", ".join(name for name, one in columns.items() if one.means == IGNORED)
    if not means & {LENGTH, DEVIATION}:
        asker.give(
            "--columns 'NAME=deviation:µm' or 'NAME=length:mm'",
            f"which column has the readings of the bar; these are not understood: {unknown}",
        )
    own = set(table.table.names) >= EXPORTED
    trace = options.trace or ("whole" if own else None if ANGLE in means else _trace(asker, unknown))
    angle = _angle(options, asker, own=own) if ANGLE in means else None
    zero_mm = options.zero_mm
    if DEVIATION in means and zero_mm is None:
        zero_mm = asker.number("length of the bar at which the deviation is 0 [mm]", "--zero-mm", needed=True)
    told = {
        "columns": columns,
        "trace": trace,
        "file_name": options.file_name,
        "split": "column" if "run" in means else options.split,
        "zone": options.zone,
        "angle": angle,
        "zero_mm": zero_mm,
        "encoding": options.encoding,
    }
    return lambda: _mapping(table, told)


def _columns(table: ForeignTable, said: Sequence[str]) -> dict[str, Proposed]:
    from dbbstation.tasks.importing.proposal import Proposed, proposed, stated

    told: dict[str, Proposed] = {}
    for text in said:
        found = stated(text)
        if found is None:
            from dbbstation.files.formats.mapping import MEANINGS

            known = ", ".join(MEANINGS)
            raise click.UsageError(
                f"--columns {text}: write NAME=MEANING or NAME=MEANING:UNIT, with one of the meanings {known}"
            )
        if found[0] not in table.table.names:
            raise click.UsageError(f"--columns {text}: the columns are {', '.join(table.table.names)}")
        told[found[0]] = found[1]
    guessed = proposed([name for name in table.table.names if name not in told], table.units)
    taken = {one.means for one in told.values()}
    if taken & {"length", "deviation"}:
        taken |= {"length", "deviation"}
    left = {name: Proposed("ignored") if one.means in taken else one for name, one in guessed.items()}
    return {name: told.get(name) or left[name] for name in table.table.names}


def _trace(asker: Asker, unknown: str) -> str:
    question = (
        "no column was taken for an angle: are the files the whole run with feed-in and feed-out, or the turn alone"
        + f"; not understood: {unknown}, say --columns 'NAME=angle:deg' where one is the angle" * bool(unknown)
    )
    return asker.text(question, "--trace", ["whole", "turn"])


def _angle(options: MappingOptions, asker: Asker, *, own: bool) -> dict[str, object]:
    grows: str | None = "ccw" if own else options.angle_grows
    grows = grows or asker.text(
        "sense in which the files' angles grow, seen from +Z", "--angle-grows", ["ccw", "cw", "travel"]
    )
    zero = 0.0 if own else options.angle_zero_deg
    if zero is None and grows != "travel":
        zero = asker.number(
            "angle in the machine, from +X to +Y, where the files have 0 [deg]", "--angle-zero-deg", needed=True
        )
    return {"grows": grows, "zero_deg": zero, "span_deg": options.angle_span_deg}


def _mapping(table: ForeignTable, data: Mapping[str, Any]) -> MappingFile:
    from pydantic import ValidationError

    from dbbstation.files.formats.mapping import MappingFile

    separator = SEPARATORS[table.language.separator]
    columns = {
        name: {"means": one.means, **({"unit": one.unit} if one.unit else {})} for name, one in data["columns"].items()
    }
    whole = {
        "format": "dbb-mapping/1",
        "separator": separator,
        "decimal": table.language.decimal,
        **data,
        "columns": columns,
    }
    try:
        return MappingFile.model_validate({key: value for key, value in whole.items() if value is not None})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"]))
        raise click.UsageError(f"the mapping{f', {place}' if place else ''}: {first['msg']}") from error
