"""The result of `compensate` and `program`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from dbbstation.facts import picked
from dbbstation.facts.serialise import Kept
from dbbstation.files.atomic import streamed
from dbbstation.files.provenance import Provenance
from dbbstation.nc.export import Program, said_acceleration
from dbbstation.nc.spilled import LongText
from dbbstation.results.frame import Framed

if TYPE_CHECKING:
    from dbbstation.machine.geometry import Machine
    from dbbstation.nc.dialect import Dialect


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
    programs: tuple[Program, ...]
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
    written: Sequence[Program],
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
        programs=tuple(written),
        model_warnings=model_warnings,
        acceleration_in_words="" if planned is None else said_acceleration(planned),
    )
