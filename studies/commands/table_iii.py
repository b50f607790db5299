"""`python -m studies table-iii`: the paper's three ways to calibrate."""

from __future__ import annotations

from typing import Any

import click

TITLES = {
    "centre_deviation_um": "mean centre deviation relative to position a",
    "mean_radial_error_um": "mean radial error, absolute",
    "circularity_um": "mean circularity",
    "flatness_um": "flatness over 380 x 380 mm",
    "parallelism_um": "parallelism along X, 380 mm",
}


@click.command()
@click.option("--machines", default=100, show_default=True, type=click.IntRange(min=5), help="Random machines.")
@click.option(
    "--rigid", is_flag=True, help="Simulate struts that gravity does not stretch: machines with kinematic errors only."
)
@click.option("--seed", default=1, show_default=True, type=click.IntRange(min=0), help="Seed of the first machine.")
@click.option("--json", "as_json", is_flag=True, help="Print the numbers as JSON.")
def table_iii(*, machines: int, rigid: bool, seed: int, as_json: bool) -> None:
    r"""Calibrate random machines in the paper's three ways and verify them on the jig [CAL Table III, Fig 7].

    Conv-A puts balls under the spindle and removes the centres. Conv-B does the same with set-up errors measured to 1
    µm. Proposed uses raw circles on the jig plate. Default leaves the machine uncalibrated. Each machine has random
    kinematic errors of 0.1 mm. Without --rigid it also has the reference machine's gravity, which no method models.

    \b
    Examples:
      python -m studies table-iii
      python -m studies table-iii --machines 20 --rigid --json
    """
    from dbbstation.cli.output import print_json
    from dbbstation.files.formats.machine import read_machine
    from dbbstation.files.formats.plan import read_plan
    from dbbstation.files.places import shipped_folder
    from studies.commands.progress import progress_bar
    from studies.table_iii import table_iii as experiment

    machine = read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")
    plans = shipped_folder("protocols") / "plans"
    conventional, jig = read_plan(plans / "conventional.yaml"), read_plan(plans / "table2.yaml")
    seeds = range(seed, seed + machines)
    with progress_bar("machines", machines) as advance:
        found = experiment(machine, conventional, jig, seeds, advance, gravity=not rigid)
    numbers = {"seed": seed, "gravity": not rigid, **found.numbers()}
    if as_json:
        print_json(numbers)
    else:
        _print(numbers)


def _print(numbers: dict[str, Any]) -> None:
    from dbbstation.cli.output import print_table

    click.echo(f"{numbers['machines']} random machines, median (90 % range) [µm]")
    rows = []
    for figure, title in TITLES.items():
        row = [title]
        for of in numbers[figure].values():
            low, high = of["range"]
            row += [f"{of['median']:.1f} ({low:.1f} to {high:.1f})", _published(of["published"])]
        gain = numbers["gain_over_conv_a"][figure]
        low, high = gain["range"]
        row += [f"{gain['median']:.1f} ({low:.1f} to {high:.1f})", f"{gain['published']:.1f}"]
        rows.append(row)
    methods = [method for method in numbers["flatness_um"] for method in (method, "paper")]
    print_table(["", *methods, "Conv-A / proposed", "paper"], rows)


def _published(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"
