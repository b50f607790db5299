"""`dbbstation mismatch --simulator`: a simulator in the loop."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dbbstation.cli.effects import LIKELY, SURELY_FOUND, first_names, not_written, parts_with_gain, residual_text
from dbbstation.cli.output import echo

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dbbstation.diagnosis.simulator.answer import SimulatorComparison
    from dbbstation.files.formats.number_language import NumberLanguage
    from dbbstation.results.simulator import PortTerm, SimulatorParameterResult, SimulatorResult


def refuse_unallowed(simulator: Path, *, allow: bool) -> None:
    """Refuse to run a simulator that neither the user nor the user's settings have allowed."""
    from dbbstation.cli.output import say
    from dbbstation.cli.shop import shop_settings
    from dbbstation.simulators.allowed import require_allowed

    setting = shop_settings().values.get("simulators")
    problem = require_allowed(simulator, setting.value if setting else (), allow=allow)
    if problem:
        say(f"note: {problem}")


def mismatch_with_simulator(
    recordings: Sequence[Path],
    simulator: Path,
    own_files: Sequence[Path],
    numbers: NumberLanguage | None,
    *,
    matters: float | None,
    most_runs: int | None,
    hold_out: bool,
    keeps: bool,
    out: Path | None,
    corrected: Path | None,
    figure: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    """Compare a simulator with recordings; print and write the results."""
    from dbbstation.cli.output import print_result, say
    from dbbstation.cli.progress import stage_bar
    from dbbstation.diagnosis.simulator.answer import find
    from dbbstation.diagnosis.simulator.model import SimulationRequest
    from dbbstation.files.atomic import refuse_existing
    from dbbstation.files.provenance import refuse_existing_table
    from dbbstation.results.of_simulator import simulator_result
    from dbbstation.results.simulator import SimulationsRun
    from dbbstation.simulators.loading import load_simulator
    from dbbstation.simulators.running import MOST_SECONDS, Runs

    for path in (out, figure):
        if path is not None:
            refuse_existing(path, force=force)
    if corrected is not None:
        refuse_existing_table(corrected, force=force)
    loaded = load_simulator(simulator, recordings, own_files, numbers)
    model = loaded.model
    with Runs(loaded, most=most_runs, keeps=keeps) as runs:
        values = [parameter.value for parameter in model.parameters]
        one_s = runs.allow([SimulationRequest(k, model.of_run(k, values)) for k in range(len(model.runs))])
        limit = f"{runs.most} are allowed at the most"
        if most_runs is None:
            limit = f"{MOST_SECONDS / 60.0:.0f} minutes are allowed, which about {runs.most} fit into"
        say(f"note: a simulation takes {one_s:.2g} s, {limit} (--most-runs)")
        with stage_bar("comparison", STAGES if hold_out else STAGES_WHOLE) as progress:

            def told(text: str, done: int = 0, of: int = 0) -> None:
                left = runs.left_s
                spent = (
                    f"{text}, {runs.ran} of {runs.most} simulations, {left:.0f} s at the most left" if left else text
                )
                progress(spent, done, of)

            answer = find(model, runs, own=loaded.own, hold_out=hold_out, matters=matters, progress=told)
        result = simulator_result(answer, SimulationsRun(runs.ran, runs.most, one_s, runs.found))
    offered = result.levels.correction is not False
    result = _written(answer, result, out if offered else None, corrected, figure, force=force)
    if as_json:
        print_result(result)
    else:
        _print(result)
    if out is not None and not offered:
        raise not_written(out, result.levels)


def _written(
    answer: SimulatorComparison,
    result: SimulatorResult,
    out: Path | None,
    corrected: Path | None,
    figure: Path | None,
    *,
    force: bool,
) -> SimulatorResult:
    """Write what is asked for, and return the result with the names of the files."""
    from dbbstation.cli.provenance import provenance
    from dbbstation.files.atomic import write_bytes, write_text
    from dbbstation.files.provenance import write_table
    from dbbstation.simulators.code import missing_code

    if out is not None:
        write_text(out, missing_code(answer), force=force)
        result = replace(result, out=str(out))
    if corrected is not None:
        write_table(corrected, _corrected(answer), provenance(), force=force)
        result = replace(result, corrected=str(corrected))
    if figure is not None:
        from dbbstation.cli.figure_option import format_of
        from dbbstation.report.simulator_figure import simulator_figure

        write_bytes(figure, simulator_figure(answer, format_of(figure)), force=force)
        result = replace(result, figure=str(figure))
    return result


STAGES = {"refit": 0, "look": 5, "sets of causes": 10, "held-out part": 40}
STAGES_WHOLE = {"refit": 0, "look": 5, "sets of causes": 20}
"""Stages of a comparison with the held-out test and without it, and the share of its time that has passed by then [%]."""


def _corrected(answer: SimulatorComparison) -> str:
    """Return a table of run, time, and each output's measured, simulated, refitted and corrected values."""
    from dbbstation.files.recordings.table_csv import table_csv

    work, model = answer.work, answer.model
    names, columns = ["run", "t_s"], [[], []]  # type: ignore[var-annotated]  # texts and numbers
    for k, run in enumerate(model.runs):
        columns[0] += [str(k + 1)] * len(run)
        columns[1] += run.inputs["t"].tolist()
    outputs = len(model.outputs)
    left = {
        "simulated": answer.as_simulated,
        "refitted": answer.base.fitted.residual,
        "corrected": answer.found.residual,
    }
    for o, output in enumerate(model.outputs):
        own = [rows for b, rows in enumerate(work.blocks) if b % outputs == o]
        names.append(f"{output.name}_measured")
        columns.append([value for rows in own for value in work.measured[rows].tolist()])
        for name, rows_left in left.items():
            values = work.measured - rows_left * work.scale
            names.append(f"{output.name}_{name}")
            columns.append([value for rows in own for value in values[rows].tolist()])
    return table_csv(names, columns)


def _print(result: SimulatorResult) -> None:
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
            f"{held_out.corrected:.3g} {unit} rms corrected; over {len(held_out.parts)} parts, each chosen anew and simulated"
        )
    elif there:
        echo("\nheld-out parts were not asked for, or not reached: whether what is found predicts was not tested.")
    echo()
    _print_left(result)
    if result.next:
        echo("\nmeasure next:")
        for step in result.next:
            echo(f"  {step.text}")


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
        echo(
            "No mismatch was found before: whether what the refitted simulator leaves is noise was not asked to the end."
        )
    else:
        echo(
            f"No mismatch: what the refitted simulator leaves, {rms.refitted:.3g} {unit} rms, is noise.".replace(
                "  ", " "
            )
        )
    noise = ", ".join(f"{o.name} {o.noise:.3g} {o.unit}".rstrip() for o in result.outputs)
    if len(result.outputs) == 1:
        noise = f"{result.noise.sigma:.3g} {unit}".rstrip()
    echo(f"noise of one row: {noise}")
    if not result.settled and not result.stopped:
        echo("The search did not settle: what it ended at is not the only set of terms that it came by.")


def _print_left(result: SimulatorResult) -> None:
    beyond = "" if result.left.is_noise else " No term at a port says it."
    echo(residual_text(result.left, result.unit) + beyond)
    for verdict in ("not-testable", "ruled-out"):
        names = [f.name for f in result.findings if f.verdict == verdict]
        if names:
            echo(f"{verdict}: {first_names(names)}")


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
        echo(f"\n{f.name}" + (f" ({f.about})" if f.about else ""))
        values = ", ".join(f"{name} {value.in_words}" for name, value in f.values.items())
        if values and len(f.values) <= MOST_VALUES:
            echo(f"  {values}")
        if f.text:
            echo(f"  {f.text}")


def _print_parameters(parameters: Sequence[SimulatorParameterResult]) -> None:
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
