"""`dbbstation mismatch`: compare any simulation with any recording, given as a table or a simulator."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dbbstation.cli.declared import CommandOutput, command, figure
from dbbstation.cli.effects import (
    LIKELY,
    SURELY_FOUND,
    cancelling_text,
    not_written,
    parts_with_gain,
    print_finding,
    print_left,
)
from dbbstation.cli.output import echo, print_table, provenance
from dbbstation.cli.shop import shop_settings
from dbbstation.tasks.mismatch import mismatch as task

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dbbstation.diagnosis.simulator.answer import RefittedOfSimulator
    from dbbstation.errors import OutputError
    from dbbstation.inference.read_off import CauseFinding
    from dbbstation.results.mismatch import MismatchResult
    from dbbstation.results.simulator import PortTerm, SimulatorResult


def show(result: MismatchResult | SimulatorResult) -> None:
    """Print the findings."""
    from dbbstation.results.simulator import SimulatorResult

    if isinstance(result, SimulatorResult):
        show_simulator(result)
    else:
        _print(result)


def _write_table(result: MismatchResult | SimulatorResult, path: Path, *, force: bool) -> None:
    from dbbstation.files.provenance import write_table
    from dbbstation.results.simulator import SimulatorResult

    if isinstance(result, SimulatorResult):
        write_table(path, result.rows_csv, provenance(), force=force)
    else:
        result.save(path, force=force, provenance=provenance)


def _refused(result: MismatchResult | SimulatorResult, path: Path) -> OutputError | None:
    return not_written(path, result.levels) if result.levels.correction is False else None


def _allowed() -> dict[str, object]:
    setting = shop_settings().values.get("simulators")
    return {"allowed": setting.value if setting else ()}


mismatch = command(
    task,
    show,
    CommandOutput("out", "CODE.py", refused=_refused, only_with="simulator"),
    CommandOutput(
        "table",
        write=_write_table,
        table=True,
        refused=lambda result, path: None if hasattr(result, "rows_csv") else _refused(result, path),
        field="corrected",
    ),
    figure(),
    more=_allowed,
)


def _print(result: MismatchResult) -> None:
    unit, held_out = result.unit, result.held_out_rms
    if held_out and held_out.worse and result.levels.follows:
        _print_worse("rows", held_out.after, held_out.as_simulated, unit)
    if result.stopped:
        echo(
            f"Ended early: {result.stopped}. This is the best answer so far; with fewer columns (--variables) the search is shorter.\n"
        )
    echo("\n".join((*result.sentences(), "")))
    print_table(
        "variable, kind, unit, from, to",
        [[v.name, v.kind, v.unit or "none", f"{v.low:.5g}", f"{v.high:.5g}"] for v in result.variables],
    )
    echo()
    _print_whether(result)
    there = [f for f in result.findings if f.verdict in SURELY_FOUND]
    equivalent = {name for f in there for name in f.equivalent}
    likely = [f for f in result.findings if f.verdict == "ambiguous" and f.probability >= LIKELY]
    there += [f for f in likely if f.name not in equivalent]
    if there:
        echo()
        _print_findings(there, unit)
    if result.cancelling:
        echo(f"\n{cancelling_text(result.cancelling)}")
    _print_parameters(result)
    if held_out:
        echo(
            f"\nheld-out error: {held_out.as_simulated:.3g} as simulated, {held_out.before:.3g} refitted, {held_out.after:.3g} {unit} rms corrected; over {len(held_out.folds)} parts, each predicted by causes chosen without it"
        )
    elif any(f.verdict == "identified" for f in there):
        echo("\nno parts were held out: predictions of the identified causes were not tested.")
    print_left(result)


def _print_worse(what: str, corrected: float, as_simulated: float, unit: str) -> None:
    sizes = f"{corrected:.3g} corrected, {as_simulated:.3g} {unit} rms as simulated.\n".replace("  ", " ")
    echo(f"Held-out {what} are predicted worse than as simulated: {sizes}")


def _print_whether(result: MismatchResult) -> None:
    unit, noise, rms = result.unit, result.noise, result.residual_rms
    # The levels above tell whether something differs; what follows them is its size.
    differs = result.levels.differs.answer
    if differs == "cannot tell":
        said = f"These rows differ by {rms.before:.3g} {unit} rms, of which {rms.after:.3g} {unit} is not explained."
    elif result.mismatch and differs == "yes":
        said = f"There is a mismatch: {rms.before:.3g} {unit} rms, of which {rms.after:.3g} {unit} is not explained."
    else:
        said = f"No mismatch: what differs, {rms.before:.3g} {unit} rms, is noise."
    echo(said.replace("  ", " "))
    fitted = "" if noise.measured_in_order else "; fitted jointly, since the order of the rows is unknown"
    alike = f", {noise.rows_as_one:.3g} rows count as one" if noise.rows_as_one > 1.0 else ""
    if noise.degrees_of_freedom:
        alike += f", long tails (Student's t, {noise.degrees_of_freedom:g} degrees of freedom)"
    if noise.grows_with:
        alike += f", its variance grows with {noise.grows_with}"
    echo(f"noise of one row: {noise.sigma:.3g} {unit}{alike}{fitted}")


def _print_findings(there: Sequence[CauseFinding], unit: str) -> None:
    tested = any(f.gains for f in there)
    rows = [
        [
            f.name,
            f.verdict,
            f"{f.probability:.3f}",
            f"{f.log_bayes_factor:.0f}",
            f"{f.rms:.2g}",
            f"{100 * f.confounded:.0f} %",
            *([parts_with_gain(f.gains, acts=f.acts)] if tested else []),
        ]
        for f in there
    ]
    head = ["effect", "verdict", "probability", "log Bayes factor", f"{unit} rms".strip(), "concealed"]
    print_table([*head, *(["parts with a gain"] if tested else [])], rows)
    for f in there:
        if f.verdict == "ambiguous" and len(there) > MOST_TOLD:
            continue
        print_finding(f, MOST_VALUES)


MOST_TOLD = 12
"""Number of effects above which only certain effects are printed in full."""

MOST_VALUES = 6
"""Greatest number of printed values of an effect; the JSON has the values of curves."""


def _print_parameters(result: MismatchResult) -> None:
    parameters = result.parameters[0 if result.offset is None else 1 :]
    if not parameters:
        return
    echo("\nparameters of the simulation, fitted anew:")
    for p in parameters:
        before, after = p.before.in_words, p.after.in_words
        echo(f"  {p.name}: {before} alone, {after} with the found effects; R² {p.confounded:.2f} with them")
        if p.far:
            echo(f"    {TOO_FAR_STATED if p.stated else TOO_FAR}")


TOO_FAR = (
    "It moves the simulated value more than twice as far as that was off: simulate anew with the new value, since the derivative "
    "may not hold so far."
)
TOO_FAR_STATED = (
    "It is more than three of its stated standard uncertainties away: check what was stated, and simulate anew."
)


def show_simulator(result: SimulatorResult) -> None:
    """Print the findings on a simulator."""
    unit, held_out = result.unit, result.held_out_rms
    _print_simulated(result)
    findings = result.findings
    there = [f for f in findings if f.verdict in SURELY_FOUND]
    likely = [f for f in findings if f.verdict == "ambiguous" and (f.put_in or f.probability >= LIKELY)]
    if there or likely:
        echo()
        _print_terms([*there, *likely])
    _print_refitted(result.parameters)
    if held_out:
        echo(
            f"\nheld-out error: {held_out.as_simulated:.3g} as simulated, {held_out.refitted:.3g} refitted, "
            f"{held_out.corrected:.3g} {unit} rms corrected; over {len(held_out.parts)} parts, each predicted by terms chosen without it"
        )
    elif there:
        echo("\nno parts were held out, or the search ended before: predictions were not tested.")
    print_left(result, "" if result.left.is_noise else " No term at a port says it.")


def _print_simulated(result: SimulatorResult) -> None:
    unit, rms, held_out = result.unit, result.rms, result.held_out_rms
    if held_out and held_out.worse:
        _print_worse("parts", held_out.corrected, held_out.as_simulated, unit)
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


MOST_VALUES_OF_TERM = 4


def _print_terms(there: Sequence[PortTerm]) -> None:
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
    print_table("term, verdict, probability, log Bayes factor, concealed, parts with a gain", rows)
    for f in there:
        print_finding(f, MOST_VALUES_OF_TERM, f" ({f.about})" if f.about else "")


def _print_refitted(parameters: Sequence[RefittedOfSimulator]) -> None:
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
    print_table("parameter, stated, refitted, corrected, unit, concealed it", rows)
    for p in parameters:
        alike = p.not_told_apart_from
        if alike is not None:
            what = f"from {', '.join(alike)}" if alike else "from anything: no output answers to it"
            echo(f"  The recordings cannot tell {p.name} {what}.")
