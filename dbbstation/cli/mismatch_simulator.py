"""`dbbstation mismatch --simulator`: a simulator in the loop."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dbbstation.cli.effects import LIKELY, SURELY_FOUND, parts_with_gain, print_finding, print_left
from dbbstation.cli.output import echo

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.diagnosis.simulator.answer import RefittedOfSimulator
    from dbbstation.results.simulator import PortTerm, SimulatorResult


def show_simulator(result: SimulatorResult) -> None:
    """Print the findings on a simulator."""
    unit, held_out = result.unit, result.held_out_rms
    _print_whether(result)
    findings = result.findings
    there = [f for f in findings if f.verdict in SURELY_FOUND]
    likely = [f for f in findings if f.verdict == "ambiguous" and (f.put_in or f.probability >= LIKELY)]
    if there or likely:
        echo()
        _print_findings([*there, *likely])
    _print_parameters(result.parameters)
    if held_out:
        echo(
            f"\nheld-out error: {held_out.as_simulated:.3g} as simulated, {held_out.refitted:.3g} refitted, "
            f"{held_out.corrected:.3g} {unit} rms corrected; over {len(held_out.parts)} parts, each predicted by terms chosen without it"
        )
    elif there:
        echo("\nno parts were held out, or the search ended before: predictions were not tested.")
    print_left(result, "" if result.left.is_noise else " No term at a port says it.")


def _print_whether(result: SimulatorResult) -> None:
    unit, rms, held_out = result.unit, result.rms, result.held_out_rms
    if held_out and held_out.worse:
        echo(
            f"Held-out parts are predicted worse than as simulated: {held_out.corrected:.3g} corrected, "
            f"{held_out.as_simulated:.3g} {unit} rms as simulated.\n".replace("  ", " ")
        )
    if result.stopped:
        echo(f"Ended early: {result.stopped}. Allow more with --most-runs.\n")
    echo("\n".join((*result.sentences(), "")))
    if result.mismatch:
        echo(
            f"There is a mismatch: {rms.as_simulated:.3g} {unit} rms as simulated, {rms.refitted:.3g} refitted, "
            f"{rms.corrected:.3g} corrected."
        )
    elif result.stopped:
        echo("No mismatch was found so far; the search ended before it had tested all of the residual.")
    else:
        echo(
            f"No mismatch: the residual of the refitted simulator, {rms.refitted:.3g} {unit} rms, is noise.".replace(
                "  ", " "
            )
        )
    noise = ", ".join(f"{o.name} {o.noise:.3g} {o.unit}".rstrip() for o in result.outputs)
    if len(result.outputs) == 1:
        noise = f"{result.noise.sigma:.3g} {unit}".rstrip()
    echo(f"noise of one row: {noise}")
    if not result.settled and not result.stopped:
        echo("The search did not converge: it found several sets of terms.")


MOST_VALUES = 4


def _print_findings(there: Sequence[PortTerm]) -> None:
    from dbbstation.cli.output import print_table

    rows = [
        [
            f.name,
            f.verdict,
            f"{f.probability:.3f}",
            f"{f.log_bayes_factor:.0f}",
            f"{100.0 * f.confounded:.0f} %",
            parts_with_gain(f.gains),
        ]
        for f in there
    ]
    print_table(["term", "verdict", "probability", "log Bayes factor", "concealed", "parts with a gain"], rows)
    for f in there:
        print_finding(f, MOST_VALUES, f" ({f.about})" if f.about else "")


def _print_parameters(parameters: Sequence[RefittedOfSimulator]) -> None:
    from dbbstation.cli.output import print_table

    if not parameters:
        return
    echo("\nparameters of the simulator:")
    rows = [
        [
            p.name,
            f"{p.stated:.4g}",
            replace(p.refitted, unit="").in_words,
            replace(p.corrected, unit="").in_words,
            p.unit,
            f"{100.0 * p.confounded:.0f} %",
        ]
        for p in parameters
    ]
    print_table(["parameter", "stated", "refitted", "corrected", "unit", "concealed it"], rows)
    for p in parameters:
        alike = p.not_told_apart_from
        if alike is not None:
            what = f"from {', '.join(alike)}" if alike else "from anything: no output answers to it"
            echo(f"  The recordings cannot tell {p.name} {what}.")
