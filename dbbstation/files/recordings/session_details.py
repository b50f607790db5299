"""Facts that a session notes in addition to its runs."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dbbstation.files.recordings.entries import Note, ReadBy
    from dbbstation.files.recordings.seal import Amendment, Seal
    from dbbstation.files.recordings.session_set_up import SetUpReadings
    from dbbstation.plan.bar import Bar


@dataclass(frozen=True, eq=False)
class SessionDetails:
    """Facts that a session notes in addition to its runs; all are optional.

    Attributes:
        bar_waiver: why the bar has no fresh calibration; empty if it has.
        set_up_errors: micrometer readings of balls under the spindle.
        instrument: at the beginning; None: not noted.
    """

    serial_number: str = ""
    operator: str = ""
    ambient_temp_c: float | None = None
    bar: Bar | None = None
    bar_waiver: str = ""
    set_up_errors: tuple[SetUpReadings, ...] = ()
    seal: Seal | None = None
    amendments: tuple[Amendment, ...] = ()
    notes: tuple[Note, ...] = ()
    job: str = ""
    instrument: ReadBy | None = None

    @property
    def noted(self) -> bool:
        """Return whether anything is noted."""
        return any(getattr(self, each.name) != each.default for each in fields(SessionDetails))
