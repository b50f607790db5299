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
    prefer: str | None,
    accepted_um: float | None,
    time_s: float | None,
    largest_mm: float,
    force: bool,
    as_json: bool,
) -> None:
    r"""Compensate an NC program: what it writes takes the real machine where PROGRAM means to go.

    Moves at feed are split into the longest pieces that keep the chord error. Where the control cannot keep the feed in
    such pieces, the program is refused with the feed that it reaches, unless --prefer decides.

    The program must be in machine coordinates and name all six axes in its first move, or --start says where the machine
    stands. It must be whole (M2, M30 or percent signs), not compensated yet, and of no other machine. Travel, feeds and the
    size of corrections are checked before anything is written.

    \b
    Examples:
      dbbstation compensate part.ngc --model model.yaml --out part-compensated.ngc
      dbbstation compensate part.nc --from linuxcnc --model model.yaml --out true.ngc --start 0,0,-1000,0,0,0
      dbbstation compensate part.ngc --model model.yaml --out fast.ngc --prefer feed
    """
    from dataclasses import replace

    from dbbstation.cli.programs import loaded_inverse, origin_of, parsed_pose, preferred, print_programs, read_source
    from dbbstation.files.atomic import refuse_existing, write_text
    from dbbstation.files.own_dialects import dialect_given
    from dbbstation.nc.export import compensated_program
    from dbbstation.nc.registry import dialect_of_file

    pose = None if start is None else parsed_pose(start)
    refuse_existing(out, force=force)
    written_in = dialect_given(dialect)
    text = read_source(program_file)
    reader = dialect_of_file(str(program_file), text) if source is None else dialect_given(source)
    path = reader.read(text, str(program_file), start=pose)
    inverse = loaded_inverse(model_file, time_s, source_files, largest_mm)
    inverse = replace(inverse, prefer=preferred(prefer), accepted_um=accepted_um)
    done = compensated_program(
        path,
        written_in,
        inverse,
        chord_mm=chord_um / 1e3,
        origin=origin_of({"program file": program_file}, inverse),
    )
    write_text(out, done.text, force=force)
    print_programs([(out, done)], written_in, inverse.model.machine, model_file, as_json=as_json)
