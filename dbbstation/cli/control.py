"""`dbbstation control`: the correction inside a control."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dbbstation.cli.number_types import Finite
from dbbstation.cli.output import echo
from dbbstation.cli.shared_options import source_file_option
from dbbstation.tasks.control_state import numbers_of

if TYPE_CHECKING:
    from collections.abc import Sequence

_FILE = click.Path(path_type=Path, dir_okay=False)
_MODEL = click.option("--model", "model_file", type=_FILE, required=True, help="Calibrated model.")
_MACHINE = click.option("--machine", type=_FILE, help="Machine file that the model must agree with.")
_FORCE = click.option("--force", is_flag=True, help="Overwrite existing files.")
_JSON = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")


@click.group()
def control() -> None:
    """Correct a machine inside its control: a LinuxCNC kinematics made from the model, or parameters for an existing one.

    \b
    Examples:
      dbbstation control kinematics --model model.yaml --out dbbkins.comp
      dbbstation control parameters --model model.yaml --out genhexkins
    """  # noqa: D301 (click reads the escape)


@control.command()
@_MODEL
@source_file_option
@click.option("--out", type=_FILE, required=True, help="Component to write: NAME.comp.")
@_MACHINE
@click.option(
    "--leave-out",
    "left_out",
    multiple=True,
    metavar="SOURCE,...",
    help="Leave these sources uncorrected; may be given more than once.",
)
@click.option(
    "--thermometers",
    "thermometers",
    multiple=True,
    metavar="NAME,...",
    help="Thermometers of the control, as columns without `_temp_c`; may be given more than once.",
)
@_FORCE
@_JSON
def kinematics(
    *,
    model_file: Path,
    source_files: tuple[Path, ...],
    out: Path,
    machine: Path | None,
    left_out: tuple[str, ...],
    thermometers: tuple[str, ...],
    force: bool,
    as_json: bool,
) -> None:
    """Write a LinuxCNC kinematics component that takes the real machine to the commanded pose.

    It holds every source that depends on pose, strut length or thermometers. A source that depends on the way so far, such as
    play, is refused by name; --leave-out leaves it uncorrected.

    \b
    Examples:
      dbbstation control kinematics --model model.yaml --out dbbkins.comp
      dbbstation control kinematics --model model.yaml --out dbbkins.comp --leave-out backlash --thermometers machine
    """  # noqa: D301 (click reads the escape)
    from datetime import UTC, datetime

    from dbbstation.cli.output import print_result, say
    from dbbstation.files.own_sources import every_source
    from dbbstation.tasks.control import kinematics as written

    result = written(
        model_file,
        out,
        date=datetime.now(UTC).date().isoformat(),
        known=every_source(source_files),
        machine=machine,
        left_out=_each(left_out),
        thermometers=_each(thermometers),
        force=force,
    )
    for note in result.notes:
        say(f"note: {note}")
    if as_json:
        print_result(result)
        return
    echo(f"{result.file} corrects {', '.join(result.parts) or 'nothing'}")
    if result.left_out:
        echo(f"not corrected: {', '.join(result.left_out)}")
    _print("Install", result.install)
    _print("INI file", result.ini)
    _print("HAL file", result.hal)
    _print("Machine file to use from then on", [result.machine_file])
    _print("The way back", result.way_back)


def _six(_context: click.Context, _option: click.Parameter, text: str | None) -> object:
    try:
        return None if text is None else numbers_of(text, {6})
    except ValueError as error:
        raise click.BadParameter(str(error)) from None


@control.command()
@_MODEL
@source_file_option
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), required=True, help="Folder to write to.")
@_MACHINE
@click.option(
    "--volume",
    callback=_six,
    metavar="X,X,Y,Y,Z,Z",
    help="Least and greatest X, Y and Z [mm]  [default: 200 mm, middle].",
)
@click.option("--tilt-deg", type=Finite(0, 90), default=15.0, show_default=True, help="Greatest A and B [deg].")
@click.option("--ini", type=_FILE, help="INI file in use: tables and backlash that it has are named.")
@_FORCE
@_JSON
def parameters(
    *,
    model_file: Path,
    source_files: tuple[Path, ...],
    out: Path,
    machine: Path | None,
    volume: Sequence[float] | None,
    tilt_deg: float,
    ini: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    """Write values and joint tables for LinuxCNC's own genhexkins, refitted over a volume.

    A weaker way than `control kinematics`: refitted values imitate what genhexkins lacks. They are numbers for a control, never
    the machine. The table states the remaining errors of the tool in the volume.

    \b
    Examples:
      dbbstation control parameters --model model.yaml --out genhexkins
      dbbstation control parameters --model model.yaml --out genhexkins --volume -80,80,-80,80,-1050,-950 --tilt-deg 10
    """  # noqa: D301 (click reads the escape)
    from datetime import UTC, datetime

    from dbbstation.cli.output import print_result, print_table, say
    from dbbstation.files.own_sources import every_source
    from dbbstation.tasks.control import parameters as written

    result = written(
        model_file,
        out,
        date=datetime.now(UTC).date().isoformat(),
        known=every_source(source_files),
        machine=machine,
        volume_mm=volume,
        tilt_deg=tilt_deg,
        ini=ini,
        force=force,
    )
    for note in result.notes:
        say(f"note: {note}")
    if as_json:
        print_result(result)
        return
    echo(f"{result.folder}: {', '.join(result.files)}")
    spans = ", ".join(f"{axis} {a:g} to {b:g}" for axis, a, b in zip("XYZAB", result.low, result.high, strict=False))
    echo(f"\nremaining errors in the volume {spans} [µm, deg]:")
    rows = [[o.way, o.rms_um, o.largest_um, o.tilt_rms_deg, o.tilt_largest_deg] for o in result.left]
    print_table(
        ["control", "rms", "largest", "tilt rms", "tilt largest"],
        [[way, f"{rms:.2f}", f"{most:.2f}", f"{tilt:.5f}", f"{tilted:.5f}"] for way, rms, most, tilt, tilted in rows],
    )
    echo("\neach source alone, without and with parameters and tables [µm rms]:")
    print_table(
        ["source", "alone", "left", "held by"],
        [[o.name, _um(o.rms_um), _um(o.left_rms_um), o.held_by] for o in result.sources],
    )
    _print("INI file", result.ini)
    _print("The way back", result.way_back)


def _each(texts: tuple[str, ...]) -> list[str]:
    return [name.strip() for text in texts for name in text.split(",") if name.strip()]


def _um(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _print(title: str, lines: Sequence[str]) -> None:
    echo()
    echo(f"{title}:")
    for line in lines:
        echo(f"  {line}")
