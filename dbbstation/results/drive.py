"""Mass, friction and what is left out of one strut drive: the result of `drive`."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated

from dbbstation.diagnosis.drive.findings import DriveFindings
from dbbstation.facts.serialise import Absent
from dbbstation.results.frame import Framed

if TYPE_CHECKING:
    from collections.abc import Callable


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveResult(Framed, DriveFindings):
    """What is found of one strut drive, to show and to keep.

    Attributes:
        compared: file of what was compared; absent where none was written.
        figure: file of the figure; absent where none was written.
    """

    compared: Annotated[str | None, Absent] = None
    figure: Annotated[str | None, Absent] = None

    def rows(self) -> list[dict[str, object]]:
        """One dictionary for each cause."""
        shown = ("name", "verdict", "probability", "gain", "concealed", "signature_rms_n", "text")
        return [{name: getattr(one, name) for name in shown} for one in self.sources]


def drive_result(found: DriveFindings, drawing: Callable[[object], bytes] | None = None) -> DriveResult:
    """Return what was found as a result that can be shown."""
    return DriveResult(**{one.name: getattr(found, one.name) for one in fields(found)}, drawing=drawing)
