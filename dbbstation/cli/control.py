"""`dbbstation control`: correct a machine inside its control."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import click

from dbbstation.cli.declared import Answer, made
from dbbstation.cli.output import echo, echo_each, print_table, say
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Names, Option
from dbbstation.tasks.options import numbers_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

_Result = TypeVar("_Result", bound=Any)


@dataclass(frozen=True, kw_only=True)
class ModelOptions:
    """The corrected machine."""

    model: Annotated[Path, o.MODEL]
    source_files: o.SourcePaths = ()
    machine: Annotated[Path | None, replace(o.MACHINE, kind="file")] = None

    def written(self, task: Callable[..., _Result], out: Path, **given: Any) -> _Result:  # noqa: ANN401 - as the task has it
        """Return the result of a task, and print its notes."""
        from dbbstation.files.own_sources import every_source

        day, known = datetime.now(UTC).date().isoformat(), every_source(self.source_files)
        result = task(self.model, out, date=day, known=known, machine=self.machine, **given)
        for note in result.notes:
            say(f"note: {note}")
        return result


@click.group()
def control() -> None:
    r"""Correct a machine inside its control: a LinuxCNC kinematics made from the model, or parameters for an existing one.

    \b
    Examples:
      dbbstation control kinematics --model model.yaml --out dbbkins.comp
      dbbstation control parameters --model model.yaml --out genhexkins
    """


@made(group=control)
def kinematics(
    of: ModelOptions,
    *,
    out: Annotated[Path, replace(o.OUT, metavar="NAME.comp")],
    leave_out: Annotated[
        Names, Option("Leave these sources uncorrected; may be given more than once.", metavar="SOURCE,...")
    ] = (),
    thermometers: Annotated[
        Names,
        Option(
            "Thermometers of the control: the names of their columns without `_temp_c`; may be given more than once.",
            metavar="NAME,...",
        ),
    ] = (),
    force: o.Force = False,
) -> Answer:
    r"""Write a LinuxCNC kinematics component that moves the real machine to the commanded pose.

    The component contains every source that depends on pose, strut length or thermometers. A source that depends on
    earlier motion, such as play, is refused by name; --leave-out leaves it uncorrected.

    \b
    Examples:
      dbbstation control kinematics --model model.yaml --out dbbkins.comp
      dbbstation control kinematics --model model.yaml --out dbbkins.comp --leave-out backlash --thermometers machine
    """
    from dbbstation.tasks.control import kinematics as task

    result = of.written(task, out, left_out=leave_out, thermometers=thermometers, force=force)

    def words() -> None:
        echo(f"{result.file} corrects {', '.join(result.parts) or 'nothing'}")
        if result.left_out:
            echo(f"not corrected: {', '.join(result.left_out)}")
        _print("Install", result.install)
        _print("INI file", result.ini)
        _print("HAL file", result.hal)
        _print("Machine file to use from then on", [result.machine_file])
        _print("The way back", result.way_back)

    return Answer(result, words)


@made(group=control)
def parameters(
    of: ModelOptions,
    *,
    out: Annotated[Path, replace(o.OUT, kind="folder", metavar="FOLDER")],
    volume: Annotated[
        list[float] | None,
        Option(
            "Least and greatest X, Y and Z [mm]  [default: 200 mm, middle].",
            metavar="X,X,Y,Y,Z,Z",
            parse=partial(numbers_of, counts={6}),
        ),
    ] = None,
    tilt_deg: Annotated[float, Option("Greatest A and B [deg].", least=0.0, most=90.0)] = 15.0,
    ini: Annotated[
        Path | None,
        Option(
            "INI file in use. The command names the joint tables and backlash that it contains already.", kind="file"
        ),
    ] = None,
    force: o.Force = False,
) -> Answer:
    r"""Write values and joint tables for LinuxCNC's own genhexkins, refitted over a volume.

    The result is less exact than with `control kinematics`. The refitted values imitate effects that genhexkins
    lacks; they do not describe the machine. The table states the remaining errors of the tool in the volume.

    \b
    Examples:
      dbbstation control parameters --model model.yaml --out genhexkins
      dbbstation control parameters --model model.yaml --out genhexkins --volume -80,80,-80,80,-1050,-950 --tilt-deg 10
    """
    from dbbstation.tasks.control import parameters as task

    result = of.written(task, out, volume_mm=volume, tilt_deg=tilt_deg, ini=ini, force=force)

    def words() -> None:
        echo(f"{result.folder}: {', '.join(result.files)}")
        spans = ", ".join(
            f"{axis} {a:g} to {b:g}" for axis, a, b in zip("XYZAB", result.low, result.high, strict=False)
        )
        echo(f"\nremaining errors in the volume {spans} [µm, deg]:")
        rows = [
            [one.way, _um(one.rms_um), _um(one.largest_um), f"{one.tilt_rms_deg:.5f}", f"{one.tilt_largest_deg:.5f}"]
            for one in result.left
        ]
        print_table("control, rms, largest, tilt rms, tilt largest", rows)
        echo("\neach source alone, without and with parameters and tables [µm rms]:")
        print_table(
            "source, alone, left, held by",
            [[one.name, _um(one.rms_um), _um(one.left_rms_um), one.held_by] for one in result.sources],
        )
        _print("INI file", result.ini)
        _print("The way back", result.way_back)

    return Answer(result, words)


def _um(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _print(title: str, lines: Sequence[str]) -> None:
    echo(f"\n{title}:")
    echo_each(f"  {line}" for line in lines)
