"""`dbbstation circles`: the figures of measured circles after ISO 230-4, without a model."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from dbbstation.cli.declared import CommandOutput, command, figure
from dbbstation.cli.output import COVERAGE_FACTOR, EXPANDED, echo, echo_each, print_table
from dbbstation.facts.digits import expanded_uncertainty, with_uncertainty
from dbbstation.tasks.circles import circles as task
from dbbstation.tasks.declare import Option

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
    titles = ["test", "dir", "n", *_titles(_OF_RUN), "step", "closure", "drift", "noise"]
    for run in result.runs:
        name = [*([run.session] if several else []), *run.key]
        if isinstance(run, RunWithoutCircle):
            rows.append([*name, *["-"] * (len(titles) - len(run.key))])
            continue
        drift = run.drift_um_per_turn
        rows.append(
            [
                *name,
                *_figures(run, _OF_RUN),
                max((abs(step.height_um) for step in run.reversal_steps), default="-"),
                "-" if run.closure is None else run.closure.height_um,
                "-" if drift is None else drift,
                _fixed(run.noise_um.of_a_reading),
            ]
        )
    print_table([*head, *titles], rows)
    if result.pairs:
        echo("\nboth directions")
        rows = []
        for pair in result.pairs:
            name = [pair.session] if several else []
            rows.append([*name, pair.test, pair.repeat, *_figures(pair, _OF_PAIR), pair.h_deg])
        print_table([*head, "test", "n", *_titles(_OF_PAIR), "at [deg]"], rows)
    echo("\nG, F and H exclude the contribution of noise; --budget states this contribution.")
    echo_each(why_not(result))


_OF_RUN = ("G", "G(LS)", "Fmax", "Fmin", "X", "Y")
_OF_PAIR = ("G(b)", "G(b)(LS)", "D", "H")


def _titles(figures: Sequence[str]) -> list[str]:
    return [title for figure in figures for title in (figure, "U")]


def _figures(run: CircleFiguresResult | PairFigures, figures: Sequence[str]) -> list[str]:
    budgets = [run.uncertainty[figure] for figure in figures]
    shown = [with_uncertainty(one.value_um, expanded_uncertainty(one.u_um, COVERAGE_FACTOR)) for one in budgets]
    return [cell for pair in shown for cell in pair]


def _fixed(number: float | None, decimals: int = 2) -> str:
    return "-" if number is None else f"{number:.{decimals}f}"


def _print_budgets(result: CirclesResult) -> None:
    from dbbstation.results.circles import not_stated, with_budgets

    rows: list[list[object]] = []
    for run in with_budgets(result):
        for quantity, budget in run.uncertainty.items():
            name = [run.test, getattr(run, "direction", "both"), run.repeat, quantity]
            rows += [[*name, cause, f"{size:.3f}"] for cause, size in budget.terms_um.items()]
            rows.append([*name, "u, all together", _fixed(budget.u_um, 3)])
            if budget.as_read_um != budget.value_um:
                taken = abs(budget.as_read_um - budget.value_um)
                rows.append([*name, "added by noise, taken off", f"{taken:.3f}"])
    echo("\nstandard uncertainties u [µm]")
    print_table("test, dir, n, figure, term, u", rows)
    echo(f"not stated, and therefore not in U: {', '.join(not_stated(result))}")


def _print_findings(runs: Sequence[CircleFiguresResult | RunWithoutCircle]) -> None:
    from dbbstation.quality.finding import FindingVerdict

    found = [(run, finding) for run in runs for finding in run.findings or ()]
    rows: list[list[object]] = [
        [
            *run.key,
            finding.name,
            _fixed(finding.value),
            _fixed(finding.limit),
            finding.unit,
            finding.verdict,
        ]
        for run, finding in found
    ]
    echo("\nfindings")
    print_table("test, dir, n, finding, value, limit, unit, verdict", rows)
    wrong = [
        f"{run.test} {run.direction} {run.repeat}: {finding.name}: {finding.text}"
        for run, finding in found
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
                    one.place,
                    *(with_uncertainty(one.value or 0.0, COVERAGE_FACTOR * (one.u or 0.0)) if known else ("-", "-")),
                    one.unit,
                    ("yes" if one.seen else "no") if known else "-",
                    one.text,
                ]
            )
    echo(f"\nquick look at the signatures of serial axes, {EXPANDED}")
    echo("On a hexapod these are symptoms, no causes: it has no axes X and Y. Causes: `dbbstation diagnose`.")
    print_table("test, dir, n, signature, at, value, U, unit, seen, ", rows)
