"""Identify a strut drive's mass and friction, and physics beyond them."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from dbbstation.diagnosis.drive.identify import identify
from dbbstation.diagnosis.drive.sources.registry import drive_sources_named, known_drive_sources
from dbbstation.files.recordings.drive_csv import read_drive
from dbbstation.results.drive import drive_result
from dbbstation.tasks.load import paths_of
from dbbstation.tasks.telling import Telling, never, silent

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.diagnosis.drive.findings import DriveFindings
    from dbbstation.results.drive import DriveResult
    from dbbstation.tasks.load import Sessions
    from dbbstation.tasks.telling import Progress

STAGES = {"speed and acceleration": 0, "sets of causes": 2, "look": 5, "held-out part": 40, "held-back stretch": 98}
"""Stages of an identification, and the share of its time that has passed by then [%]."""


def drive(
    recordings: Sessions,
    *,
    force_per_ampere: float | None = None,
    sources: Sequence[str] | None = None,
    cutoff_hz: float | None = None,
    hold_out: bool = True,
    progress: Progress = silent,
    stop: Callable[[], bool] = never,
    say: Callable[[str], None] = silent,
) -> DriveResult:
    """Identify one strut drive from position and force, and find what mass and viscous friction leave out.

    Args:
        recordings: CSV files with `t_s`, `position_mm` and `force_n` or `motor_current_a`.
        force_per_ampere: force at 1 A [N/A], for currents.
        sources: names of causes; None: all.
        cutoff_hz: bandwidth of the comparison; None: chosen from the recording.
        hold_out: check on parts that took no part in the choice; takes most of the time.

    Returns:
        What was found; `drawing` draws it, and `table` has what was compared.

    Raises:
        InputError: faults of the files.
        ModelError: an unknown cause.
        CalibrationError: the recordings have no strokes to and fro.
        StoppedError: `stop` returned True.
    """
    telling = Telling(progress, stop, say)
    named = drive_sources_named(known_drive_sources() if sources is None else sources)
    files = [read_drive(path) for path in paths_of(recordings)]
    telling.note(*(str(warning) for file in files for warning in file.warnings))
    raw = [file.recording(force_per_ampere) for file in files]
    found = identify(raw, named, cutoff_hz, telling.stage, hold_out=hold_out)
    result = drive_result(found, partial(_drawn, found))
    telling.note(*result.noticed)
    return result


def _drawn(found: DriveFindings, wanted: object) -> bytes:
    from dbbstation.report.drive_figure import drive_figure  # noqa: PLC0415 - half a second for who draws nothing
    from dbbstation.report.figure_format import figure_format  # noqa: PLC0415

    return drive_figure(found, figure_format(wanted))
