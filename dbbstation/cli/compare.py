"""`dbbstation compare`: where two sessions differ."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dbbstation.cli.chosen_tests import chosen_tests_options
from dbbstation.cli.figure_option import figure_option, format_of
from dbbstation.cli.output import echo

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.tasks.load import Recorded


STAGES = {"candidates": 1, "sets of causes": 30, "look": 60, "held-out tests": 80}
"""How much of a comparison is done when each stage begins [%]."""


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
    r"""Put two sessions side by side: where they differ, in what form, and by which cause; differences are B less A.

    For last year against today, or a simulation against a recording. The readings of A are the simulation of B. What is
    stated of noise, mountings, CMM sheets and bars is no difference. Error sources that may have changed, balls and bars that
    sit elsewhere, and effects without a name compete by their probability, as in `diagnose`.

    \b
    Examples:
      dbbstation compare 2025-11-18-hexapod-7 2026-11-20-hexapod-7
      dbbstation compare predicted 2026-11-20-hexapod-7 --figure difference.svg
      dbbstation compare predicted 2026-11-20-hexapod-7 --json
    """
    from dbbstation.cli.output import print_json, say
    from dbbstation.cli.progress import stage_bar
    from dbbstation.diagnosis.compare.comparison import compare as put_side_by_side
    from dbbstation.diagnosis.compare.notes import notes_of
    from dbbstation.diagnosis.compare.summary import comparison_summary
    from dbbstation.diagnosis.diagnose import usable_sources
    from dbbstation.files.atomic import refuse_existing, write_bytes
    from dbbstation.report.compare_figure import compare_figure
    from dbbstation.sources.registry import known_sources, sources_named
    from dbbstation.tasks.diagnose import default_candidates

    if figure is not None:
        refuse_existing(figure, force=force)
    one, other = _both(a, b, tests, exclude)
    for name, recorded in (("A", one), ("B", other)):
        for warning in recorded.warnings:
            say(f"note: {name}: {warning}")
    candidates = sources_named(default_candidates(known_sources()))
    usable, lacking = usable_sources(one.machine, [*one.observations, *other.observations], candidates)
    with stage_bar("comparison", STAGES) as progress:
        found = put_side_by_side(one.machine, one.observations, other.observations, usable, lacking, progress)
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
    """Read both sessions, distinguished by more than their names.

    Raises:
        InputError: a fault of either; one session given twice.
    """
    from dbbstation.cli.progress import count_bar
    from dbbstation.errors import InputError, Problem
    from dbbstation.tasks.load import load_sessions

    with count_bar(f"reading {a.name}") as reading:
        one = load_sessions([a], exclude, reading, tests)
    with count_bar(f"reading {b.name}") as reading:
        other = load_sessions([b], exclude, reading, tests)
    if set(one.sessions.values()) == set(other.sessions.values()):
        what = f"this is the same session as {a}, byte for byte"
        raise InputError([Problem(str(b), 0, 0, what, "give two sessions")])
    return one, other


def _print(summary: Mapping[str, Any]) -> None:
    if summary["held_out_worse"]:
        echo("Held-out tests are predicted worse than by the first session alone. Nothing is identified.\n")
    echo(summary["text"])
    for note in summary["notes"]:
        echo(f"- {note}")
    for title, key in (("only in A", "only_in_a"), ("only in B", "only_in_b"), ("averaged", "averaged")):
        if summary[key]:
            echo(f"- {title}: {', '.join(summary[key])}")
    for one in summary["not_comparable"]:
        echo(f"- not comparable: test {one['test']}: {one['text']}")
    echo()
    _print_runs(summary)
    _print_causes(summary)


def _print_runs(summary: Mapping[str, Any]) -> None:
    from dbbstation.cli.output import print_table

    echo(
        "B less A [µm], largest first; found: rms of what was found; sigmas: how far that is out; u: standard uncertainty by noise, "
        "balls and bars"
    )
    titles = ["test", "dir", "n", "found", "sigmas", "rms", "noise", "centre x", "y", "u", "mean", "u", "G", "peak"]
    rows = [
        [
            run["test"],
            run["direction"],
            run["number"],
            f"{run['found_rms_um']:.2f}",
            f"{run['found_sigmas']:.0f}",
            f"{run['rms_um']:.2f}",
            f"{run['noise_rms_um']:.2f}",
            *(_tenths(shift) for shift in run["centre_shift_um"]),
            f"{run['centre_shift_uncertainty_um']:.1f}",
            _tenths(run["mean_radial_change_um"]),
            f"{run['mean_radial_change_uncertainty_um']:.1f}",
            f"{run['circularity_um']:.1f}",
            _tenths(run["peak_um"]),
            f"{run['peak_theta_deg']:.0f}",
            "differs" if run["differs"] else "",
        ]
        for run in summary["runs"]
    ]
    print_table([*titles, "at deg", ""], rows)


def _tenths(value: float) -> str:
    """Print with one digit, zero without a sign."""
    return f"{round(value, 1) + 0.0:.1f}"


def _groups_with_gain(cause: Mapping[str, Any]) -> str:
    """In how many groups of tests that were held back a cause brought something; empty where no other tests can show it."""
    gains = cause["gains"]
    return f"{gains['with_gain']} of {len(gains['parts'])}" if gains and cause["acts"] == "always" else ""


def _print_causes(summary: Mapping[str, Any]) -> None:
    from dbbstation.cli.output import print_table

    there = [cause for cause in summary["causes"] if cause.get("where")]
    if there:
        echo(
            "\nwhat the sessions differ by; share: of all that was found; opposite: part that changes its sign with the "
            "direction; calibration: part that a new calibration would take up"
        )
        rows = [
            [
                f"{cause['name']}, {cause['form']}" if cause["form"] else cause["name"],
                cause["verdict"],
                f"{cause['probability']:.3f}",
                _groups_with_gain(cause),
                f"{cause['rms_um']:.2f}",
                *(f"{100 * cause[key]:.0f} %" for key in ("share", "opposite", "taken_up")),
                cause["where"]["text"],
            ]
            for cause in there
        ]
        titles = ["cause", "verdict", "probability", "gain in", "µm rms", "share", "opposite", "calibration", "where"]
        print_table(titles, rows)
        for cause in there:
            if cause["text"]:
                echo(f"{cause['name']}: {cause['text']}")
        echo(f"\nin short: {summary['organised_text']}")
        held = summary["held_out_rms_um"]
        echo(
            f"held-out tests: {held['before']:.2f} -> {held['after']:.2f} µm rms, once their balls and bars have settled"
        )
    echo(f"\n{summary['left']['text']}")
    for verdict in ("ambiguous", "ruled-out", "not-testable"):
        names = [c["name"] for c in summary["causes"] if c["named"] and c["verdict"] == verdict and not c.get("where")]
        if names:
            echo(f"{verdict}: {', '.join(dict.fromkeys(names))}")
    echo(f"`dbbstation diagnose {summary['b']}` looks for causes in one session by itself.")
