"""`dbbstation compensate`: any NC program through the inverse of a calibrated model."""

from __future__ import annotations

from pathlib import Path

import click

from dbbstation.cli.correction import largest_correction_option
from dbbstation.cli.keeping import keeping_options
from dbbstation.cli.number_types import Finite
from dbbstation.cli.shop import shop_option
from dbbstation.cli.source_files import source_file_option

_FILE = click.Path(path_type=Path, dir_okay=False)


@click.command()
@click.argument("program_file", type=_FILE, metavar="PROGRAM")
@click.option("--model", "model_file", type=_FILE, required=True, help="Calibrated model.")
@source_file_option
@shop_option(
    "--dialect",
    setting="program.dialect",
    metavar="D",
    default="linuxcnc",
    show_default=True,
    help="Language to write: a name, or FILE.py.",
)
@click.option("--from", "source", metavar="D", help="Language of PROGRAM, likewise [default: by its extension].")
@click.option("--out", type=_FILE, required=True, help="File to write.")
@click.option("--start", metavar="X,Y,Z,A,B,C", help="Pose before the program, in mm and degrees.")
@shop_option(
    "--chord-um",
    setting="program.chord_um",
    type=Finite(0.001, 1000.0),
    default=0.1,
    show_default=True,
    help="Greatest distance between a straight move and the path, arcs and correction together [µm].",
)
@keeping_options
@click.option(
    "--time-s",
    type=Finite(),
    metavar="S",
    help="Start of the program after the session's start [s], for models that depend on time.",
)
@largest_correction_option
@click.option("--machine", type=_FILE, help="Machine file: refuse if it says that the control corrects already.")
@click.option("--force", is_flag=True, help="Overwrite the file.")
@click.option("--json", "as_json", is_flag=True, help="Print what was written as JSON.")
def compensate(
    *,
    program_file: Path,
    model_file: Path,
    source_files: tuple[Path, ...],
    dialect: str,
    source: str | None,
    out: Path,
    start: str | None,
    chord_um: float,
    prefer: str,
    strict: bool,
    time_s: float | None,
    largest_mm: float,
    machine: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    r"""Compensate an NC program: what it writes takes the real machine where PROGRAM means to go.

    Moves at feed are split into the longest pieces that keep the chord error. If the control is slower in such pieces, the
    output states about how much. --strict refuses the program instead.

    The program must be in machine coordinates and name all six axes in its first move, or --start says where the machine
    stands. It must be whole (M2, M30 or percent signs), not compensated yet, and of no other machine. Travel, feeds and the
    size of corrections are checked before anything is written.

    \b
    Examples:
      dbbstation compensate part.ngc --model model.yaml --out part-compensated.ngc
      dbbstation compensate part.nc --from linuxcnc --model model.yaml --out true.ngc --start 0,0,-1000,0,0,0
      dbbstation compensate part.ngc --model model.yaml --out true.ngc --strict
    """
    from dbbstation.cli.output import say
    from dbbstation.cli.programs import parsed_pose, print_programs
    from dbbstation.cli.provenance import provenance
    from dbbstation.files.own_sources import every_source
    from dbbstation.tasks.compensate import compensate as compensated

    pose = None if start is None else parsed_pose(start)
    every = every_source(source_files)
    result = compensated(
        program_file,
        model_file,
        out,
        dialect=dialect,
        written_in=source,
        start=pose,
        chord_um=chord_um,
        prefer=prefer,
        strict=strict,
        time_s=time_s,
        largest_correction_mm=largest_mm,
        machine=machine,
        force=force,
        known=every,
        provenance=provenance,
        say=lambda text: say(f"note: {text}"),
    )
    print_programs(result, as_json=as_json)
