"""`python -m studies concealed-gravity`: gravity hidden in a kinematic calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from dbbstation.cli.output import format_of
from studies.figure_option import figure_option

if TYPE_CHECKING:
    from pathlib import Path


@click.command()
@click.option("--seed", default=1, show_default=True, type=click.IntRange(min=0), help="Seed of everything random.")
@figure_option()
@click.option("--force", is_flag=True, help="Overwrite the figure.")
@click.option("--json", "as_json", is_flag=True, help="Print the numbers as JSON.")
def concealed_gravity(*, seed: int, figure: Path | None, force: bool, as_json: bool) -> None:
    r"""Conceal gravity in a kinematic calibration; find, name and model it.

    \b
    Examples:
      python -m studies concealed-gravity
      python -m studies concealed-gravity --seed 5 --figure concealed.svg --json
    """
    from dbbstation.cli.output import print_json, say
    from dbbstation.cli.progress import stage_bar
    from dbbstation.files.atomic import refuse_existing, write_bytes
    from dbbstation.files.formats.machine import read_machine
    from dbbstation.files.formats.plan import read_plan
    from dbbstation.files.places import shipped_folder
    from dbbstation.tasks.diagnose import STAGES
    from studies.concealed_figure import concealed_figure
    from studies.concealed_gravity import concealed_gravity as experiment

    if figure is not None:
        refuse_existing(figure, force=force)
    machine = read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")
    plans = shipped_folder("protocols") / "plans"
    jig, conditions = read_plan(plans / "table2.yaml"), read_plan(plans / "gravity-conditions.yaml")
    with stage_bar("study", STAGES) as progress:
        found = experiment(machine, jig, conditions, seed=seed, progress=progress)
    if figure is not None:
        write_bytes(figure, concealed_figure(found, format_of(figure)), force=force)
        say(f"figure written to {figure}")
    if as_json:
        print_json(found.numbers)
    else:
        _print(found.numbers)


def _print(numbers: dict[str, Any]) -> None:
    from dbbstation.cli.output import print_table

    residual, compliance = numbers["residual_um"], numbers["compliance_um_kn"]
    click.echo("Before: a kinematic calibration of the fifteen circles on the jig plate")
    click.echo(f"  leaves {residual['kinematic']:.1f} µm rms within mountings")
    click.echo(f"  ({residual['without_gravity_in_the_machine']:.1f} µm if the machine had no gravity)")
    click.echo(
        f"  gravity bends these circles by {numbers['signature_um']:.1f} µm rms; the kinematic parameters conceal"
    )
    click.echo(
        f"  {100 * numbers['concealed']:.0f} % of its sum of squares, {numbers['unconcealed_um']:.1f} µm rms remain"
    )
    shift = numbers["base_joint_shift_um"]
    click.echo(f"  bias of the base joints up to {shift['greatest']:.0f} µm, {shift['rms']:.0f} µm rms")
    click.echo("Named")
    click.echo(f"  gravity: {numbers['verdict']}")
    click.echo("Modelled")
    click.echo(
        f"  strut compliance {compliance['found']:.3f} ± {compliance['uncertainty']:.3f} µm/kN, true "
        f"{compliance['true']:.3f}"
    )
    held_out = numbers["held_out_um"]
    click.echo(f"After: {residual['joint']:.2f} µm rms within mountings;")
    click.echo(f"  held-out tests predicted to {held_out['kinematic']:.1f} µm before, {held_out['joint']:.2f} µm after")
    click.echo("\nThe circle about (0, 100, -1008) mm, tilted by -23 degrees, if compensated with")
    rows = [
        [name, of["circularity_um"], of["centre_deviation_um"], of["greatest_position_error_um"]]
        for name, of in numbers["tilted_circle"].items()
    ]
    print_table(["", "G, no noise in it", "centre deviation", "greatest position error [µm]"], rows)
    click.echo("(in the last column a common height remains, which level circles on the jig do not see)")
