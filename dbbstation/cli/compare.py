"""`dbbstation compare`: where two sessions differ."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.declared import command, figure
from dbbstation.cli.effects import cancelling_text, parts_with_gain
from dbbstation.cli.output import echo, echo_line, print_table
from dbbstation.tasks.compare import compare as task

if TYPE_CHECKING:
    from dbbstation.results.comparison import ComparisonResult


def show(result: ComparisonResult) -> None:
    """Print where the sessions differ."""
    if result.held_out_worse:
        echo("Held-out tests are predicted worse than by the first session alone.\n")
    echo("\n".join((*result.sentences(), "", result.text)))
    for note in result.unlike:
        echo_line(f"- {note}")
    for title, names in (
        ("only in A", result.only_in_a),
        ("only in B", result.only_in_b),
        ("averaged", result.averaged),
    ):
        if names:
            echo_line(f"- {title}: {', '.join(names)}")
    for one in result.not_comparable:
        echo_line(f"- not comparable: test {one.test}: {one.text}")
    echo()
    _print_runs(result)
    _print_causes(result)


def _print_runs(result: ComparisonResult) -> None:
    echo(
        "B minus A [µm], largest first; found: rms of the found difference; sigmas: size in standard deviations; u: standard uncertainty by noise, balls and bars"
    )
    titles = "test, dir, n, found, sigmas, rms, noise, centre x, y, u, mean, u, G, peak, at deg, "
    rows = [
        [
            run.test,
            run.direction,
            run.number,
            f"{run.found_rms_um:.2f}",
            f"{run.found_sigmas:.0f}",
            f"{run.rms_um:.2f}",
            f"{run.noise_rms_um:.2f}",
            *run.centre_shift_um,
            f"{run.centre_shift_uncertainty_um:.1f}",
            run.mean_radial_change_um,
            f"{run.mean_radial_change_uncertainty_um:.1f}",
            f"{run.circularity_um:.1f}",
            run.peak_um,
            f"{run.peak_theta_deg:.0f}",
            "differs" if run.differs else "",
        ]
        for run in result.runs
    ]
    print_table(titles, rows)


def _print_causes(result: ComparisonResult) -> None:
    from dbbstation.results.comparison import ComparedCause

    there = [cause for cause in result.causes if isinstance(cause, ComparedCause) and cause.where is not None]
    if there:
        echo(
            "\ndifferences of the sessions; share: of all found differences; opposite: part that changes its sign with the direction; calibration: part that a new calibration would absorb"
        )
        rows = [
            [
                f"{cause.name}, {cause.form}" if cause.form else cause.name,
                cause.verdict,
                f"{cause.probability:.3f}",
                parts_with_gain(cause.gains, acts=cause.acts),
                f"{cause.rms_um:.2f}",
                *(f"{100 * (share or 0.0):.0f} %" for share in (cause.share, cause.opposite, cause.taken_up)),
                cause.where.text if cause.where else "",
            ]
            for cause in there
        ]
        titles = "cause, verdict, probability, gain in, µm rms, share, opposite, calibration, where"
        print_table(titles, rows)
        for cause in there:
            if cause.text:
                echo(f"{cause.name}: {cause.text}")
        echo(f"\nin short: {result.organised_text}")
        if result.cancelling:
            echo(cancelling_text(result.cancelling))
        held = result.held_out_rms_um
        echo(f"held-out tests: {held.before:.2f} -> {held.after:.2f} µm rms, after a fit of their balls and bars")
    echo(f"\n{result.left.text}")
    for verdict in ("ambiguous", "ruled-out", "not-testable"):
        names = [c.name for c in result.causes if c.named and c.verdict == verdict and c not in there]
        if names:
            echo(f"{verdict}: {', '.join(dict.fromkeys(names))}")
    echo(f"`dbbstation diagnose {result.b}` looks for causes in one session by itself.")


compare = command(task, show, figure(said="figure written to {path}"))
