"""The result of `drive`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from dbbstation.diagnosis.drive.findings import DriveFindings
from dbbstation.facts import of_facts
from dbbstation.facts.serialise import Absent
from dbbstation.files.provenance import Provenance, write_table
from dbbstation.files.recordings.drive_csv import compared_csv
from dbbstation.results.frame import Framed
from dbbstation.results.levels_text import level_sentences

if TYPE_CHECKING:
    from collections.abc import Callable


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveResult(Framed, DriveFindings):
    """Findings on one strut drive."""

    compared: Annotated[str | None, Absent] = None
    figure: Annotated[str | None, Absent] = None
    _table_of = "sources", "name, verdict, probability, gain, concealed, signature_rms_n, text"

    def sentences(self) -> list[str]:
        """Return the answer in three levels, in words."""
        values = {one.name: one.parameters for one in self.sources}
        what = "Measured force and the law with mass and friction"
        return level_sentences(self.levels, "N", values, rows="samples", what=what)

    def _save(self, path: Path, provenance: Provenance, *, force: bool) -> None:
        write_table(path, compared_csv(self.table), provenance, force=force)


def drive_result(found: DriveFindings, drawing: Callable[[object], bytes] | None = None) -> DriveResult:
    """Return the findings as a result with table and figure."""
    return of_facts(DriveResult, found, drawing=drawing)
