"""`dbbstation compensate`: any NC program through the inverse of a calibrated model."""

from __future__ import annotations

from pathlib import Path

import click

from dbbstation.cli.control_state import control_options, lengths_by_tool, named_numbers, numbers_of
from dbbstation.cli.correction import largest_correction_option
from dbbstation.cli.number_types import Finite
from dbbstation.cli.shared_options import keeping_options, source_file_option
from dbbstation.cli.shop import shop_option

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
@click.option("--written-in", "source", metavar="D", help="Language of PROGRAM, likewise [default: by its extension].")
@click.option("--out", type=_FILE, required=True, help="File to write.")
@control_options
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
    "--unexplained", is_flag=True, help="Correct an error of unknown cause, too, that a diagnosis kept in the model."
)
@click.option(
    "--time-s",
    type=Finite(),
    metavar="S",
    help="Start of the program after the session's start [s], for models that depend on time.",
)
@largest_correction_option
@click.option("--machine", type=_FILE, help="Machine file; refused if its control already corrects.")
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
    angles: str | None,
    offsets: tuple[str, ...],
    parameters: Path | None,
    lengths: tuple[str, ...],
    tools: Path | None,
    chord_um: float,
    prefer: str,
    strict: bool,
    unexplained: bool,
    time_s: float | None,
    largest_mm: float,
    machine: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    r"""Compensate an NC program, so that the real machine follows PROGRAM.

    Moves at feed are split into the longest pieces that keep the chord error. If the control is slower in such pieces, the
    output states about how much. --strict refuses the program instead.

    State the control's work offsets and tool lengths, or its files, and the angles of a program that names X, Y and Z only.
    The result is right for these. Its first lines stop LinuxCNC if others are in force.

    The program must be whole (M2, M30 or percent signs), not compensated yet, and of no other machine. Travel, feeds and
    the size of corrections are checked before anything is written.

    \b
    Examples:
      dbbstation compensate part.ngc --model model.yaml --out part-compensated.ngc
      dbbstation compensate block.ngc --model model.yaml --out true.ngc --angles 0,0,0 --offset G54=20,-35,-1000 --tool-length 1=52.1
      dbbstation compensate block.ngc --model model.yaml --out true.ngc --angles 0,0,0 --parameters linuxcnc.var --tools tool.tbl
      dbbstation compensate part.ngc --model model.yaml --out true.ngc --strict
    """
    from dbbstation.cli.output import say
    from dbbstation.cli.programs import print_programs
    from dbbstation.cli.provenance import provenance
    from dbbstation.files.own_sources import every_source
    from dbbstation.tasks.compensate import compensate as compensated

    every = every_source(source_files)
    result = compensated(
        program_file,
        model_file,
        out,
        dialect=dialect,
        written_in=source,
        start=None if start is None else numbers_of(start, {6}, "--start"),
        angles_deg=None if angles is None else numbers_of(angles, {3}, "--angles"),
        offsets=named_numbers(offsets, {3, 6}, "--offset"),
        parameters=parameters,
        tool_lengths_mm=lengths_by_tool(lengths),
        tools=tools,
        chord_um=chord_um,
        prefer=prefer,
        strict=strict,
        unexplained=unexplained,
        time_s=time_s,
        largest_correction_mm=largest_mm,
        machine=machine,
        force=force,
        known=every,
        provenance=provenance,
        say=lambda text: say(f"note: {text}"),
    )
    print_programs(result, as_json=as_json)
