"""What a session notes beside its runs."""

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
    """What a session notes beside its runs; everything optional.

    Attributes:
        bar_waiver: why it is measured without a fresh calibration of the bar; empty where there is one.
        set_up_errors: micrometer readings of balls that were put up under the spindle.
        seal: hashes of machine, plan and jig, and the end of the chain of runs.
        amendments: what was changed on purpose after it was sealed.
        notes: what was noted while it was measured, oldest first.
        job: job or order number, what it is measured for.
        instrument: what it was begun with; None: not noted.
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
        """Whether anything is."""
        return any(getattr(self, each.name) != each.default for each in fields(SessionDetails))
