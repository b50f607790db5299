"""`dbbstation program`: NC programs of a plan's circles."""

from __future__ import annotations

from pathlib import Path

import click

from dbbstation.cli.chosen_tests import chosen_tests_options
from dbbstation.cli.circle_options import circle_options
from dbbstation.cli.correction import largest_correction_option
from dbbstation.cli.keeping import keeping_options
from dbbstation.cli.number_types import Finite
from dbbstation.cli.shop import shop_option
from dbbstation.cli.source_files import source_file_option
from dbbstation.nc.limits import CIRCLE_CHORD_MM

_FILE = click.Path(path_type=Path, dir_okay=False)


@click.command()
@click.option("--plan", "plan_file", type=_FILE, required=True, help="Test plan.")
@click.option("--machine", "machine_file", type=_FILE, required=True, help="Machine file.")
@shop_option(
    "--dialect",
    setting="program.dialect",
    metavar="D",
    default="linuxcnc",
    show_default=True,
    help="Language of the control: a name, or FILE.py.",
)
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), required=True, help="Folder to write to.")
@click.option("--model", "model_file", type=_FILE, help="Compensate with this calibrated model.")
@source_file_option
@chosen_tests_options
@circle_options
@click.option(
    "--chord-um",
    type=Finite(0.001, 1000.0),
    default=1e3 * CIRCLE_CHORD_MM,
    show_default=True,
    help="With --model: greatest distance between a straight move and the circle [µm].",
)
@keeping_options
@click.option(
    "--time-s",
    type=Finite(),
    metavar="S",
    help="Start of the programs after the session's start [s], for models that depend on time.",
)
@largest_correction_option
@click.option("--force", is_flag=True, help="Overwrite programs.")
@click.option("--json", "as_json", is_flag=True, help="Print what was written as JSON.")
def program(
    *,
    plan_file: Path,
    machine_file: Path,
    dialect: str,
    out: Path,
    model_file: Path | None,
    source_files: tuple[Path, ...],
    tests: tuple[str, ...],
    exclude: tuple[str, ...],
    step_deg: float,
    clearance_mm: float,
    bar_stays_on: bool,
    chord_um: float,
    prefer: str,
    strict: bool,
    time_s: float | None,
    largest_mm: float,
    force: bool,
    as_json: bool,
) -> None:
    r"""Write the NC programs of a plan's circles, one for each test and direction, nominal or compensated.

    Every program is checked against the travel of axes, angles and struts before anything is written; all programs
    are written or none. A program goes above its first point, comes down to it, waits for the bar to be put on, runs
    the path of a run and waits for the bar to be taken off.

    Points of compensated programs are as far apart as the control needs for the feed, within --chord-um. If that is not
    far enough, the output states about how much slower the control is. --strict refuses the program instead.

    \b
    Examples:
      dbbstation program --plan table2.yaml --machine machine.yaml --out nominal
      dbbstation program --plan table2.yaml --machine machine.yaml --model model.yaml --out compensated
      dbbstation program --plan table2.yaml --machine machine.yaml --test a,f --out two --json
    """
    from dbbstation.cli.output import say
    from dbbstation.cli.programs import print_programs
    from dbbstation.cli.progress import count_bar
    from dbbstation.cli.provenance import provenance
    from dbbstation.files.own_sources import every_source
    from dbbstation.tasks.circle_programs import write_circle_programs

    with count_bar("programs") as writing:
        result = write_circle_programs(
            plan_file,
            machine_file,
            out,
            dialect=dialect,
            model=model_file,
            tests=tests,
            exclude=exclude,
            step_deg=step_deg,
            clearance_mm=None if bar_stays_on else clearance_mm,
            chord_um=chord_um,
            prefer=prefer,
            strict=strict,
            time_s=time_s,
            largest_correction_mm=largest_mm,
            force=force,
            known=None if model_file is None else every_source(source_files),
            provenance=provenance,
            progress=lambda _text, done=0, of=0: writing(done, of),
            say=lambda text: say(f"note: {text}"),
        )
    print_programs(result, as_json=as_json)
    if not as_json:
        say(f"{len(result.programs)} programs written to {out}, all within the machine's travel")
