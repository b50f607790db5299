"""`python -m studies coverage`: do stated intervals contain the truth?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from studies.coverage_rows import Row

SESSIONS, CIRCLES = 250, 1000
"""Draws for each row, where they are not given."""

PLANS = {"elevated": "table2-elevated", "level": "table2"}


@click.command()
@click.option(
    "--machines", default=500, show_default=True, type=click.IntRange(min=10), help="Random machines per plan."
)
@click.option("--plan", type=click.Choice(sorted(PLANS)), help="Only one of the two plans.")
@click.option("--seed", default=1, show_default=True, type=click.IntRange(min=0), help="Seed of the first machine.")
@click.option(
    "--part",
    type=click.Choice(["machines", "calibration", "bars", "circles", "feed", "noises"]),
    help="Compute this part only: random machines per plan (machines); figures of calibration and prediction (calibration), also with unknown or warm bars (bars); figures of circles (circles), their feed (feed), or circles with another generator's noises (noises).",
)
@click.option(
    "--draws",
    type=click.IntRange(min=3),
    help=f"Draws for each row of a table [default: {SESSIONS} sessions of calibration, {CIRCLES} circles of each of six noises, or {CIRCLES} recordings].",
)
@click.option(
    "--keep",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder that keeps the draws, so that an interrupted study can continue.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the numbers as JSON.")
def coverage(
    *, machines: int, plan: str | None, seed: int, part: str | None, draws: int | None, keep: Path | None, as_json: bool
) -> None:
    r"""Calibrate many random machines and count how often the 95 % intervals contain the truth.

    On the plan with five raised bars, the study checks all 24 parameters. On the level plan it checks the combinations
    that level bars determine, on machines without a common height error of the base joints. Mountings, CMM, bar and
    noise scatter as plan and session state. Predicted positions are checked up to 150 mm and 10 degrees from the middle
    of the travel.

    The table has a row for each figure of calibration and prediction, with and without a stated joint tolerance. Its
    sessions come from the independent virtual machine in tests/plant.

    Figures of circles come from serial machines of tests/plant: perfect, as good as the noise, and worn. Each has three
    sizes of white and of correlated noise. Errors of bar, temperatures and ball are drawn from their stated
    uncertainties.

    \b
    Examples:
      python -m studies coverage
      python -m studies coverage --part calibration --draws 20
      python -m studies coverage --machines 100 --plan elevated --json
      python -m studies coverage --part circles --draws 1000 --keep draws
    """
    from dbbstation.cli.output import print_json
    from dbbstation.files.formats.machine import read_machine
    from dbbstation.files.formats.plan import read_plan
    from dbbstation.files.places import shipped_folder
    from studies.commands.progress import progress_bar
    from studies.coverage import coverage as experiment

    machine = read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")
    found: dict[str, Any] = {"seed": seed}
    for name in _plans(plan, part):
        what = read_plan(shipped_folder("protocols") / "plans" / f"{PLANS[name]}.yaml")
        with progress_bar(f"{name} plan", machines) as advance:
            covered = experiment(machine, what, range(seed, seed + machines), advance, level=name == "level")
        found[name] = covered.numbers()
        if not as_json:
            _print(name, found[name])
    for which in ("calibration", "bars", "feed", "noises"):
        if plan is None and part in {None, which}:
            rows = _rows(which, draws, seed, _file(keep, which))
            found[which] = [row.plain() for row in rows]
            found["faults"] = [*found.get("faults", []), *(row.fault for row in rows if row.fault)]
            if not as_json:
                _print_rows(rows)
    if plan is None and part in {None, "circles"}:
        found["circles"] = _circles(draws or CIRCLES, seed, _file(keep, "circles"), as_json=as_json)
    if as_json:
        print_json(found)


def _file(keep: Path | None, part: str) -> Path | None:
    if keep is None:
        return None
    keep.mkdir(parents=True, exist_ok=True)
    return keep / f"{part}.jsonl"


def _plans(plan: str | None, part: str | None) -> list[str]:
    if part not in {None, "machines"}:
        return []
    return sorted(PLANS) if plan is None else [plan]


def _rows(which: str, draws: int | None, seed: int, keep: Path | None) -> list[Row]:
    """Return rows of a part with single draws."""
    from studies.commands.progress import progress_bar
    from studies.coverage_calibration import CASES, OF_BARS, coverage_of_calibration
    from studies.coverage_feed import coverage_of_feed
    from studies.coverage_noises import coverage_of_noises
    from tests.plant.other_noise import KINDS

    if which in {"calibration", "bars"}:
        cases, of = OF_BARS if which == "bars" else CASES, draws or SESSIONS
        with progress_bar("sessions", of * len(cases)) as advance:
            return coverage_of_calibration(cases, range(seed, seed + of), advance, keep)
    of = draws or CIRCLES
    if which == "feed":
        with progress_bar("recordings", of) as advance:
            return coverage_of_feed(of, seed, advance, keep)
    with progress_bar("circles", of * len(KINDS)) as advance:
        return coverage_of_noises(of, seed, advance, keep=keep)


def _print_rows(rows: list[Row]) -> None:
    from dbbstation.cli.output import print_table

    lines: list[list[object]] = []
    for row in rows:
        known = ["-", "-", "-"]
        if row.inside is not None and row.error is not None:
            known = [f"{100 * row.inside:.1f}", f"{196 * row.error:.1f}", f"{row.u:.2g} {row.unit}"]
        lines.append([row.case, row.figure, row.draws, row.values, f"{100 * row.stated:.0f}", *known, row.reason])
    titles = ["case", "figure", "draws", "values", "u stated [%]", "inside [%]", "±", "median u", "why more than 97 %"]
    print_table(titles, lines)
    for row in rows:
        if row.fault:
            click.echo(f"NOT as promised: {row.fault}")


def _circles(draws: int, seed: int, keep: Path | None, *, as_json: bool) -> dict[str, Any]:
    """Print how often U about circle figures contains the truth."""
    from dbbstation.cli.output import print_table
    from studies.commands.progress import progress_bar
    from studies.coverage_circles import CELLS, KINDS, coverage_of_circles, pooled

    with progress_bar("circles", draws * len(CELLS)) as advance:
        found = coverage_of_circles(draws, seed, advance, keep=keep)
    if as_json:
        return found
    noises = [cell.name for cell in CELLS]

    def percent(counts: tuple[int, int]) -> str:
        return "-" if not counts[1] else f"{100 * counts[0] / counts[1]:.1f}"

    click.echo(f"figures of circles, {draws} draws for each noise from seed {seed}: truth within U = 2 u, in percent")
    rows = [
        [
            name,
            *(percent(pooled(row, noise=noise)) for noise in noises),
            *(percent(pooled(row, kind=kind)) for kind in KINDS),
            percent(pooled(row)),
            pooled(row)[1],
            found["reasons"].get(name, ""),
        ]
        for name, row in found["rows"].items()
    ]
    print_table(["figure", *noises, *KINDS, "all", "values", "why more than 97 %"], rows)
    for fault in found["faults"]:
        click.echo(f"NOT as promised: {fault}")
    return found


def _print(name: str, numbers: dict[str, Any]) -> None:
    low, high = (100 * share for share in numbers["chance_of_one_parameter"])
    click.echo(f"{name} plan, {numbers['machines']} machines: truth inside the 95 % interval")
    click.echo(f"  parameters, pooled   {100 * numbers['parameters_pooled']:5.1f} %")
    click.echo(
        f"  ... one by one       {100 * numbers['parameters_least']:5.1f} to {100 * numbers['parameters_most']:.1f} %"
        f"   (of so many machines 95 in 100 parameters lie between {low:.1f} and {high:.1f})"
    )
    by_axis = ", ".join(f"{axis} {100 * share:.1f}" for axis, share in numbers["positions_by_axis"].items())
    click.echo(f"  predicted positions  {100 * numbers['positions_pooled']:5.1f} %   ({by_axis})")
