"""`dbbstation circles`: the figures of measured circles after ISO 230-4, without a model."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from dbbstation.cli.declared import CommandOutput, command, figure
from dbbstation.cli.output import COVERAGE_FACTOR, EXPANDED, echo, print_table
from dbbstation.tasks.circles import circles as task
from dbbstation.tasks.declare import Option
from dbbstation.text.written import expanded_uncertainty, with_uncertainty

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dbbstation.results.circles import (
        CircleFiguresResult,
        CirclesResult,
        PairFigures,
        QuickLookResult,
        RunWithoutCircle,
    )


def show(
    result: CirclesResult,
    sessions: Sequence[Path],
    *,
    findings: bool,
    budget: Annotated[bool, Option("Print the uncertainty budget of every figure, term by term.")] = False,
) -> None:
    """Print the figures and other requested results."""
    _print(result, several=len(sessions) > 1)
    if budget:
        _print_budgets(result)
    if findings:
        _print_findings(result.runs)
    if result.quick_look is not None:
        _print_quick_looks(result.quick_look)


circles = command(task, show, CommandOutput("table", table=True, field="csv"), figure(said="figure written to {path}"))


def _print(result: CirclesResult, *, several: bool) -> None:
    from dbbstation.results.circles import RunWithoutCircle, why_not

    echo(f"figures of {result.edition}, filter: {result.filter}, lengths in µm, {EXPANDED}")
    head = ["session"] if several else []
    rows: list[list[object]] = []
    titles = [
        "test",
        "dir",
        "n",
        "G",
        "U",
        "G(LS)",
        "U",
        "Fmax",
        "U",
        "Fmin",
        "U",
        "X",
        "U",
        "Y",
        "U",
        "step",
        "closure",
        "drift",
        "noise",
    ]
    for run in result.runs:
        name: list[object] = [run.session] if several else []
        name += [run.test, run.direction, run.repeat]
        if isinstance(run, RunWithoutCircle):
            rows.append([*name, *["-"] * (len(head) + len(titles) - len(name))])
            continue
        steps = [abs(step.height_um) for step in run.reversal_steps]
        drift = run.drift_um_per_turn
        rows.append(
            [
                *name,
                *_figure(run, "G", run.g_um),
                *_figure(run, "G(LS)", run.g_least_squares_um),
                *_figure(run, "Fmax", run.f_um.max),
                *_figure(run, "Fmin", run.f_um.min),
                *_figure(run, "X", run.centre_um.x),
                *_figure(run, "Y", run.centre_um.y),
                max(steps) if steps else "-",
                "-" if run.closure is None else run.closure.height_um,
                "-" if drift is None else drift,
                _noise(run),
            ]
        )
    print_table([*head, *titles], rows)
    if result.pairs:
        echo("\nboth directions")
        rows = []
        for pair in result.pairs:
            name = [pair.session] if several else []
            rows.append(
                [
                    *name,
                    pair.test,
                    pair.repeat,
                    *_figure(pair, "G(b)", pair.g_um),
                    *_figure(pair, "G(b)(LS)", pair.g_least_squares_um),
                    *_figure(pair, "D", pair.d_um),
                    *_figure(pair, "H", pair.h_um),
                    pair.h_deg,
                ]
            )
        print_table([*head, *["test", "n", "G(b)", "U", "G(b)(LS)", "U", "D", "U", "H", "U"], "at [deg]"], rows)
    echo("\nG, F and H exclude the contribution of noise; --budget states this contribution.")
    for line in why_not(result):
        echo(line)


def _figure(run: CircleFiguresResult | PairFigures, name: str, value: float) -> tuple[str, str]:
    return with_uncertainty(value, expanded_uncertainty(run.uncertainty[name].u_um, COVERAGE_FACTOR))


def _noise(run: CircleFiguresResult) -> object:
    noise = run.noise_um.of_a_reading
    return "-" if noise is None else f"{noise:.2f}"


def _print_budgets(result: CirclesResult) -> None:
    from dbbstation.results.circles import not_stated, with_budgets

    rows: list[list[object]] = []
    for run in with_budgets(result):
        for quantity, budget in run.uncertainty.items():
            name = [run.test, getattr(run, "direction", "both"), run.repeat, quantity]
            rows += [[*name, cause, f"{size:.3f}"] for cause, size in budget.terms_um.items()]
            u = budget.u_um
            rows.append([*name, "u, all together", "-" if u is None else f"{u:.3f}"])
            if budget.as_read_um != budget.value_um:
                taken = abs(budget.as_read_um - budget.value_um)
                rows.append([*name, "added by noise, taken off", f"{taken:.3f}"])
    echo("\nstandard uncertainties u [µm]")
    print_table(["test", "dir", "n", "figure", "term", "u"], rows)
    echo(f"not stated, and therefore not in U: {', '.join(not_stated(result))}")


def _print_findings(runs: Sequence[CircleFiguresResult | RunWithoutCircle]) -> None:
    from dbbstation.quality.finding import FindingVerdict

    rows: list[list[object]] = [
        [
            run.test,
            run.direction,
            run.repeat,
            finding.name,
            "-" if finding.value is None else f"{finding.value:.2f}",
            "-" if finding.limit is None else f"{finding.limit:.2f}",
            finding.unit,
            finding.verdict,
        ]
        for run in runs
        for finding in run.findings or ()
    ]
    echo("\nfindings")
    print_table(["test", "dir", "n", "finding", "value", "limit", "unit", "verdict"], rows)
    wrong = [
        f"{run.test} {run.direction} {run.repeat}: {finding.name}: {finding.text}"
        for run in runs
        for finding in run.findings or ()
        if finding.verdict == FindingVerdict.WRONG
    ]
    echo("\n".join(wrong) if wrong else "nothing is wrong")


def _print_quick_looks(looks: Sequence[QuickLookResult]) -> None:
    rows: list[list[object]] = []
    for look in looks:
        name = [look.test, "+".join(look.directions), look.repeat]
        if not look.symptoms:
            rows.append([*name, "too few samples", "", "-", "-", "", "-", ""])
        for one in look.symptoms:
            known = one.value is not None and one.u is not None
            rows.append(
                [
                    *name,
                    one.signature,
                    one.place or "",
                    *(with_uncertainty(one.value or 0.0, COVERAGE_FACTOR * (one.u or 0.0)) if known else ("-", "-")),
                    one.unit,
                    ("yes" if one.seen else "no") if known else "-",
                    one.text or "",
                ]
            )
    echo(f"\nquick look at the signatures of serial axes, {EXPANDED}")
    echo("On a hexapod these are symptoms, no causes: it has no axes X and Y. Causes: `dbbstation diagnose`.")
    print_table(["test", "dir", "n", "signature", "at", "value", "U", "unit", "seen", ""], rows)
