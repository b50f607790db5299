"""`python -m studies platform-joints`: the hard case, carried through."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from dbbstation.cli.declared import Finite

if TYPE_CHECKING:
    from collections.abc import Mapping


@click.command()
@click.option(
    "--seed", default=1, show_default=True, type=click.IntRange(min=0), help="Seed of machine and measurements."
)
@click.option(
    "--size-um",
    default=5.0,
    show_default=True,
    type=Finite(0.1, 500.0),
    help="Standard deviation of a joint coordinate's error.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the numbers as JSON.")
def platform_joints(*, seed: int, size_um: float, as_json: bool) -> None:
    r"""Identify platform-joint errors of some µm, of which kinematic parameters conceal 99 %.

    The machine is measured on the jig and diagnosed. The study then records the tests that the diagnosis proposes and
    diagnoses again, until platform joints are named.

    \b
    Examples:
      python -m studies platform-joints
      python -m studies platform-joints --size-um 20 --seed 4 --json
    """
    from dbbstation.cli.output import print_json
    from dbbstation.cli.progress import stage_bar
    from dbbstation.files.formats.machine import read_machine
    from dbbstation.files.formats.plan import read_plan
    from dbbstation.files.places import shipped_folder
    from studies.platform_joints import MOST_ROUNDS, numbers
    from studies.platform_joints import platform_joints as experiment

    machine = read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")
    jig = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")
    size_mm = size_um / 1e3
    rounds = {f"round {k + 1}": 100 * k // (MOST_ROUNDS + 1) for k in range(MOST_ROUNDS + 1)}
    with stage_bar("study", rounds) as progress:
        found = numbers(experiment(machine, jig, seed, size_mm, progress), seed, size_mm)
    if as_json:
        print_json(found)
    else:
        _print(found)


def _print(found: Mapping[str, Any]) -> None:
    from dbbstation.cli.output import print_table

    click.echo(f"platform joints off by {found['joint_error_um']:.0f} µm, seed {found['seed']}")
    rows = []
    for one in found["rounds"]:
        for text in one["added"]:
            click.echo(f"  added: {text}")
        error, predicted = one["workspace_error_um"], one["held_out_normalised"]
        rows.append(
            [
                one["tests"],
                one["verdict"],
                ", ".join(one["ambiguous_with"]),
                f"{one['gain']:.0f}",
                f"{100 * one['concealed']:.1f} %",
                error["kinematic"],
                error["joint"],
                "-" if error["stated"] is None else error["stated"],
                f"{predicted['before']:.2f} -> {predicted['after']:.2f}",
            ]
        )
    titles = ["tests", "verdict", "not distinguished from", "log Bayes factor", "concealed (R²)"]
    print_table([*titles, "kinematic", "joint", "stated", "held-out tests"], rows)
    click.echo(
        "kinematic, joint: true position error over the workspace less its mean, stated: as the model says [µm rms]"
    )
