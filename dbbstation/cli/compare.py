"""`dbbstation compare`: where two sessions differ."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dbbstation.cli.chosen_tests import chosen_tests_options
from dbbstation.cli.figure_option import figure_option, format_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.recorded import Recorded


@click.command()
@click.argument("a", type=click.Path(path_type=Path), metavar="A")
@click.argument("b", type=click.Path(path_type=Path), metavar="B")
@chosen_tests_options
@figure_option()
@click.option("--force", is_flag=True, help="Overwrite the figure.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def compare(
    a: Path,
    b: Path,
    *,
    tests: tuple[str, ...],
    exclude: tuple[str, ...],
    figure: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    r"""Put two sessions side by side, without a model: differences are B less A.

    For last year against today, or a simulation against a recording. The result is where they differ, by how much
    beyond the stated noise, mountings, CMM sheets and bars, and which variable the difference follows: time, height,
    tilt, direction, a strut. It names no cause; `diagnose` does, one session at a time.

    \b
    Examples:
      dbbstation compare 2025-11-18-hexapod-7 2026-11-20-hexapod-7
      dbbstation compare predicted 2026-11-20-hexapod-7 --figure difference.svg
      dbbstation compare predicted 2026-11-20-hexapod-7 --json
    """
    from dbbstation.cli.output import print_json, say
    from dbbstation.cli.progress import stage_bar
    from dbbstation.diagnosis.compare import compare as put_side_by_side
    from dbbstation.diagnosis.compare_notes import notes_of
    from dbbstation.diagnosis.compare_summary import comparison_summary
    from dbbstation.files.atomic import refuse_existing, write_bytes
    from dbbstation.report.compare_figure import compare_figure

    if figure is not None:
        refuse_existing(figure, force=force)
    one, other = _both(a, b, tests, exclude)
    for name, recorded in (("A", one), ("B", other)):
        for warning in recorded.warnings:
            say(f"note: {name}: {warning}")
    with stage_bar("comparison", {"runs": 0}) as progress:
        progress(f"runs of {a.name} and {b.name}")
        found = put_side_by_side(one.machine, one.observations, other.observations)
    notes = notes_of(one.machine, other.machine, found.matching.pairs)
    summary = {"a": str(a), "b": str(b), **comparison_summary(found, notes)}
    if figure is not None:
        write_bytes(figure, compare_figure(found, format_of(figure)), force=force)
        say(f"figure written to {figure}")
    if as_json:
        print_json(summary)
    else:
        _print(summary)


def _both(a: Path, b: Path, tests: tuple[str, ...], exclude: tuple[str, ...]) -> tuple[Recorded, Recorded]:
    """Read both sessions, told apart by more than their names.

    Raises:
        InputError: a fault of either; one session given twice.
    """
    from dbbstation.cli.progress import count_bar
    from dbbstation.errors import InputError, Problem
    from dbbstation.recorded import load_sessions

    with count_bar(f"reading {a.name}") as reading:
        one = load_sessions([a], exclude, reading, tests)
    with count_bar(f"reading {b.name}") as reading:
        other = load_sessions([b], exclude, reading, tests)
    if set(one.sessions.values()) == set(other.sessions.values()):
        what = f"this is the same session as {a}, byte for byte"
        raise InputError([Problem(str(b), 0, 0, what, "give two sessions")])
    return one, other


def _print(summary: Mapping[str, Any]) -> None:
    click.echo(summary["text"])
    for note in summary["notes"]:
        click.echo(f"- {note}")
    for title, key in (("only in A", "only_in_a"), ("only in B", "only_in_b"), ("averaged", "averaged")):
        if summary[key]:
            click.echo(f"- {title}: {', '.join(summary[key])}")
    for one in summary["not_comparable"]:
        click.echo(f"- not comparable: test {one['test']}: {one['text']}")
    click.echo()
    _print_runs(summary)
    if summary["differ"]:
        _print_organised(summary)


def _print_runs(summary: Mapping[str, Any]) -> None:
    from dbbstation.cli.output import print_table
    from dbbstation.diagnosis.compare_summary import chance_text

    click.echo(
        "B less A [µm], largest first; ratio: rms over what noise and mountings allow; u: standard uncertainty by these"
    )
    titles = [
        "test",
        "dir",
        "n",
        "ratio",
        "rms",
        "noise",
        "centre x",
        "y",
        "u",
        "mean",
        "u",
        "G",
        "peak",
        "at deg",
        "by chance",
    ]
    rows = [
        [
            run["test"],
            run["direction"],
            run["number"],
            f"{run['times_chance']:.1f}",
            f"{run['rms_um']:.2f}",
            f"{run['noise_rms_um']:.2f}",
            *(_tenths(shift) for shift in run["centre_shift_um"]),
            f"{run['centre_shift_uncertainty_um']:.1f}",
            _tenths(run["mean_radial_change_um"]),
            f"{run['mean_radial_change_uncertainty_um']:.1f}",
            f"{run['circularity_um']:.1f}",
            _tenths(run["peak_um"]),
            f"{run['peak_theta_deg']:.0f}",
            chance_text(run["probability"]) + (" differs" if run["differs"] else ""),
        ]
        for run in summary["runs"]
    ]
    print_table(titles, rows)


def _tenths(value: float) -> str:
    """Print with one digit, zero without a sign."""
    return f"{round(value, 1) + 0.0:.1f}"


def _print_organised(summary: Mapping[str, Any]) -> None:
    from dbbstation.cli.output import print_table
    from dbbstation.diagnosis.compare import SMALLEST_SHARE
    from dbbstation.diagnosis.compare_summary import chance_text

    halves = summary["directions"]
    if halves is not None:
        click.echo(
            f"\nthe same in both directions {halves['same_um']:.2f} µm rms, opposite {halves['opposite_um']:.2f} µm rms "
            f"(by chance {chance_text(halves['opposite_probability'])})"
        )
    click.echo(
        "\nvariables that the difference follows, best first; share: of what is beyond chance; of µm²: of the plain sum of squares"
    )
    rows = [
        [
            one["variable"] + ("" if one["strut"] is None else f", strut {one['strut']}"),
            f"{100 * one['share']:.0f} %",
            f"{100 * one['share_of_um2']:.0f} %",
            one["freedom"],
            chance_text(one["probability"]),
        ]
        for one in summary["organised"]
        if max(one["share"], one["share_of_um2"]) > SMALLEST_SHARE
    ]
    print_table(["variable", "share", "of µm²", "degrees of freedom", "by chance"], rows)
    click.echo(f"\nin short: {summary['organised_text']}")
    click.echo(f"No cause is named here: `dbbstation diagnose {summary['b']}` looks for one in a session.")
