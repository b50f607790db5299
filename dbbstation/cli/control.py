"""`dbbstation control`: the correction inside a control."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dbbstation.cli.output import echo
from dbbstation.cli.source_files import source_file_option

if TYPE_CHECKING:
    from collections.abc import Sequence

_FILE = click.Path(path_type=Path, dir_okay=False)
_MODEL = click.option("--model", "model_file", type=_FILE, required=True, help="Calibrated model.")
_MACHINE = click.option("--machine", type=_FILE, help="Machine file that the model must agree with.")
_FORCE = click.option("--force", is_flag=True, help="Overwrite existing files.")
_JSON = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")


@click.group()
def control() -> None:
    """Correct a machine inside its control: a LinuxCNC kinematics made of the model, or parameters for one that is there.

    \b
    Examples:
      dbbstation control kinematics --model model.yaml --out dbbkins.comp
    """  # noqa: D301 (click reads the escape)


@control.command()
@_MODEL
@source_file_option
@click.option("--out", type=_FILE, required=True, help="Component to write: NAME.comp.")
@_MACHINE
@click.option(
    "--leave-out", "left_out", multiple=True, metavar="SOURCE", help="Source that is not corrected; repeatable."
)
@click.option(
    "--thermometer",
    "thermometers",
    multiple=True,
    metavar="NAME",
    help="Thermometer of the control, as its column without `_temp_c`; repeatable.",
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
      dbbstation control kinematics --model model.yaml --out dbbkins.comp --leave-out backlash --thermometer machine
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
        left_out=left_out,
        thermometers=thermometers,
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


def _print(title: str, lines: Sequence[str]) -> None:
    echo()
    echo(f"{title}:")
    for line in lines:
        echo(f"  {line}")
