"""Identify a strut drive's mass and friction, and physics beyond them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Files, Names, Option, drawing, paths_of, task
from dbbstation.tasks.telling import Telling

if TYPE_CHECKING:
    from collections.abc import Iterable
    from typing import Unpack

    from dbbstation.files.recordings.table_csv import Columns
    from dbbstation.results.drive import DriveResult
    from dbbstation.tasks.telling import Hooks

    Recordings = Files | Columns | Iterable[Columns]
else:
    Recordings = Files

STAGES = {"speed and acceleration": 0, "sets of causes": 2, "look": 5, "held-out part": 40, "held-back stretch": 98}
"""Stages of an identification, and the share of its time that has passed at each begin [%]."""


@task("identify", label="identification", stages=STAGES)
def identify(
    recordings: Annotated[
        Recordings,
        Option(
            "CSV files with `t_s`, `position_mm` and `force_n` or `motor_current_a`; scripts may give DataFrames or mappings of arrays.",
            kind="argument",
            metavar="RECORDING.csv...",
            objects=True,
        ),
    ],
    *,
    force_per_ampere: Annotated[
        float | None, Option("Force of the drive at 1 A, for motor_current_a.", metavar="N/A")
    ] = None,
    sources: Annotated[Names | None, replace(o.SOURCES, usual="all")] = None,
    source_files: o.SourceFiles = (),
    cutoff_hz: Annotated[
        float | None,
        Option("Bandwidth in which force and model are compared [default: chosen from the recording].", metavar="HZ"),
    ] = None,
    held_out: o.HeldOut = True,
    **hooks: Unpack[Hooks],
) -> DriveResult:
    r"""Identify one strut drive from position and force, and find the physics that mass and viscous friction leave out.

    The recording is a CSV file with the columns t_s, position_mm and force_n, or motor_current_a. Record strokes to and
    fro at several speeds. Several recordings of one drive are fitted together. Verdicts: identified, happened,
    does-not-predict, ambiguous, not-testable, ruled-out.

    \b
    Examples:
      dbbstation identify strut3.csv
      dbbstation identify slow.csv fast.csv
      dbbstation identify strut3.csv --force-per-ampere 410 --figure strut3.svg
      dbbstation identify strut3.csv --sources coulomb-friction,friction-asymmetry --json

    Returns:
        What was found; `drawing` draws it, and `table` has what was compared.

    Raises:
        ArgumentError: a value that it does not take.
        InputError: faults of the files.
        ModelError: an unknown cause.
        CalibrationError: the recordings have no strokes to and fro.
        StoppedError: `stop` returned True.
    """
    from dbbstation.diagnosis.drive.identify import identify as identified_drive
    from dbbstation.diagnosis.drive.sources import drive_sources_named, known_drive_sources
    from dbbstation.files.own_classes import load_sources
    from dbbstation.files.recordings.drive_csv import given_drive, read_drive
    from dbbstation.laws.contract import MOVING
    from dbbstation.results.drive import drive_result

    telling = Telling(**hooks)
    named = drive_sources_named(known_drive_sources() if sources is None else tuple(sources))
    own, lacking = load_sources(paths_of(source_files), MOVING, "a recording of a drive")
    replaced = {source.name for source in own}
    named = (*(source for source in named if source.name not in replaced), *own)
    telling.note(*(f"{name} is not compared: {why}" for name, why in lacking.items()))
    given = recordings if isinstance(recordings, tuple) else (recordings,)
    files = [
        read_drive(one) if isinstance(one, Path) else given_drive(one, f"recording {number}")
        for number, one in enumerate(given, 1)
    ]
    telling.note(*(str(warning) for file in files for warning in file.warnings))
    raw = [file.recording(force_per_ampere) for file in files]
    found = identified_drive(raw, named, cutoff_hz, telling.stage, hold_out=held_out)
    result = drive_result(found, drawing("drive_figure", found))
    telling.note(*result.noticed)
    return result
