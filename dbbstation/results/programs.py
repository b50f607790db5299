"""The result of `compensate` and `program`."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from dbbstation.facts import of_facts, picked
from dbbstation.facts.serialise import AsItIs, Kept
from dbbstation.files.atomic import streamed
from dbbstation.files.provenance import Provenance
from dbbstation.nc.export import said_acceleration
from dbbstation.nc.spilled import LongText
from dbbstation.results.frame import Framed

if TYPE_CHECKING:
    from dbbstation.machine.geometry import Machine
    from dbbstation.nc.dialect import Dialect
    from dbbstation.nc.export import Program


@dataclass(frozen=True, kw_only=True)
class WrittenProgram:
    """One program.

    Attributes:
        greatest_correction_um: None in a nominal program.
        chord_error_um: largest distance between a move and its path.
        model_uncertainty_um: greatest standard uncertainty of the tool tip along the path; None if unknown.
        tilt_left_um: tilt correction left out, 100 mm from the tip.
        feed_s: computed time at feed; None for an unknown look-ahead.
    """

    file: str
    sha256: str
    points: int
    greatest_correction_um: float | None
    chord_error_um: float | None
    chord_asked_um: float | None
    model_uncertainty_um: float | None
    model_uncertainty_by_axis_um: Mapping[str, float | None] | None
    model_uncertainty_not_known_because: str | None
    tilt_left_um: float | None
    feed_s: float | None
    nominal_feed_s: float | None
    remarks: tuple[str, ...]
    content: Annotated[LongText, AsItIs, Kept] = field(repr=False)

    @property
    def text(self) -> str:
        """Return the whole program."""
        return str(self.content)


@dataclass(frozen=True, kw_only=True)
class ProgramsResult(Framed):
    """Programs, nominal or compensated.

    Attributes:
        acceleration_mm_s2: basis of the pieces' lengths; None if the dialect states no look-ahead.
        model_warnings: such as missing physics; empty for nominal programs.
    """

    dialect: str
    model_sha256: str | None
    acceleration_mm_s2: float | None
    acceleration_known: bool | None
    programs: tuple[WrittenProgram, ...]
    model_warnings: tuple[str, ...] = ()
    acceleration_in_words: Annotated[str, Kept] = ""

    @property
    def text(self) -> str:
        """Return the text of the program, or of several programs one after the other."""
        return "".join(one.text for one in self.programs)

    @property
    def greatest_correction_um(self) -> float | None:
        """Return the greatest correction of all programs; None in nominal programs."""
        return max((one.greatest_correction_um for one in self.programs if one.greatest_correction_um), default=None)

    def _save(self, path: Path, provenance: Provenance, *, force: bool) -> None:  # noqa: ARG002 - the text states it
        write_programs(path, [one.content for one in self.programs], force=force)

    def rows(self) -> list[dict[str, object]]:
        """Return one row per program."""
        sizes = ("greatest_correction_um", "model_uncertainty_um", "chord_error_um", "feed_s", "nominal_feed_s")
        return [picked(one, "file", "points", *sizes) for one in self.programs]


def write_programs(path: Path, contents: Iterable[LongText], *, force: bool) -> None:
    """Write programs into one file; see `streamed`."""
    with streamed(path, force=force) as file:
        file.writelines(block for content in contents for block in content.blocks())


def programs_result(
    written: Sequence[tuple[str, Program]],
    dialect: Dialect,
    machine: Machine | None,
    model_sha256: str | None,
    notes: tuple[str, ...] = (),
    model_warnings: tuple[str, ...] = (),
) -> ProgramsResult:
    """Return programs as a result."""
    planned = None if dialect.look_ahead is None else machine
    return ProgramsResult(
        notes=notes,
        dialect=dialect.name,
        model_sha256=model_sha256,
        acceleration_mm_s2=None if planned is None else planned.planned_acceleration_mm_s2,
        acceleration_known=None if planned is None else planned.acceleration_mm_s2 is not None,
        programs=tuple(_written(file, each) for file, each in written),
        model_warnings=model_warnings,
        acceleration_in_words="" if planned is None else said_acceleration(planned),
    )


def _written(file: str, each: Program) -> WrittenProgram:
    digest = hashlib.sha256()
    for block in each.content.blocks():
        digest.update(block)
    return of_facts(
        WrittenProgram,
        each,
        file=file,
        sha256=digest.hexdigest(),
        greatest_correction_um=each.greatest_um,
        chord_error_um=each.chord_um,
        model_uncertainty_um=each.uncertainty_um,
        model_uncertainty_by_axis_um=dict(zip("xyz", each.uncertainty_by_axis_um, strict=False)) or None,
        model_uncertainty_not_known_because=each.why_unknown or None,
    )
