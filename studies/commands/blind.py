"""`python -m studies blind`: hidden effects, judged blind, then compared with the answers."""

from __future__ import annotations

import os
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dbbstation.cli.output import format_of
from studies.figure_option import figure_option

if TYPE_CHECKING:
    from collections.abc import Callable


@click.command()
@click.argument(
    "folders",
    metavar="FOLDER...",
    nargs=-1,
    required=True,
    type=click.Path(path_type=Path, exists=True, file_okay=False),
)
@click.option("--candidates", metavar="A,B,...", help="Error sources to compare [default: all, as in `diagnose`].")
@click.option("--jobs", type=click.IntRange(min=1), help="Number of processes [default: all cores].")
@click.option("--again", is_flag=True, help="Diagnose sessions with a verdict again.")
@figure_option("Draw the reliability diagram here")
@click.option("--force", is_flag=True, help="Overwrite the figure.")
@click.option("--json", "as_json", is_flag=True, help="Print the numbers as JSON.")
def blind(
    *,
    folders: tuple[Path, ...],
    candidates: str | None,
    jobs: int | None,
    again: bool,
    figure: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    r"""Diagnose sessions with hidden effects, and score the verdicts.

    A FOLDER has one session folder per recording, and `answers.json`. The command opens the answers only after every
    session of every folder has its verdict. FOLDER/verdicts keeps each verdict at once, so that an interrupted study
    can continue. Several folders are scored together. --figure draws how often a cause was present, over its stated
    probability. The simulation under tests/plant makes such folders; it shares no code with this program.

    \b
    Examples:
      python -m tests.plant.blind hidden --clean 100 --single 200 --pairs 40 --outside 40 --concealed 20 --seed 1
      python -m studies blind hidden
      python -m studies blind first second
      python -m studies blind hidden --again --json > blind.json
      python -m studies blind hidden --figure reliability.svg
    """
    from dbbstation.cli.output import print_json, say
    from dbbstation.errors import InputError, Problem
    from dbbstation.files.atomic import refuse_existing, write_bytes
    from dbbstation.sources.registry import known_sources
    from dbbstation.tasks.diagnosed import default_candidates
    from studies.blind import cost, judge_sessions, read_answers
    from studies.blind_score import numbers, score
    from studies.commands.progress import progress_bar

    if figure is not None:
        refuse_existing(figure, force=force)
    names = [n.strip() for n in candidates.split(",")] if candidates else default_candidates(known_sources())
    total = sum(len(list(folder.glob("*/session.yaml"))) for folder in folders)
    verdicts: list[dict[str, dict[str, Any]]] = []
    with progress_bar("sessions", total) as advance:
        for folder in folders:
            before = sum(map(len, verdicts))
            told = partial(_further, advance, before)
            verdicts.append(judge_sessions(folder, names, jobs or os.cpu_count() or 1, told, again=again))
    outcomes = []
    for folder, judged in zip(folders, verdicts, strict=True):
        own = score(read_answers(folder), judged, names if candidates else None)
        outcomes += own if len(folders) == 1 else [replace(one, session=f"{folder.name}/{one.session}") for one in own]
    found: dict[str, Any] = {
        "candidates": list(names),
        **numbers(outcomes),
        "cost": cost([one for judged in verdicts for one in judged.values()]),
    }
    if as_json:
        print_json(found)
    else:
        _print(found)
    if figure is None:
        return
    if found["reliability"] is None:
        what = "no verdict has a probability, so there is no reliability to draw"
        raise InputError(
            [
                Problem(
                    ", ".join(map(str, folders)), 0, 0, what, "judge the sessions with --again, or leave --figure out"
                )
            ]
        )
    from studies.blind_figure import reliability_figure

    write_bytes(figure, reliability_figure(found["reliability"], format_of(figure)), force=force)
    say(f"figure written to {figure}")


def _further(advance: Callable[[int], None], before: int, done: int, _: int) -> None:
    advance(before + done)


def _print(found: dict[str, Any]) -> None:
    from dbbstation.cli.output import print_table

    click.echo(f"{found['sessions']} sessions, {len(found['candidates'])} candidates\n")
    rows = []
    for title, share in found["shares"].items():
        low, high = (100 * bound for bound in share["interval"])
        of = f"{share['hits']} of {share['count']}"
        rows.append([title, of, f"{100 * share['share']:.0f} %", f"{low:.0f} to {high:.0f} %", share["target"]])
    print_table(["", "", "share", "95 % interval", "target"], rows)
    click.echo("\nright answers of all kinds by how the samples got their angles")
    print_table(["", ""], [[label, f"{s['hits']} of {s['count']}"] for label, s in found["right_by_recording"].items()])
    if len(found["right_by_law"]) > 1:
        click.echo("\nright answers by how closely hidden effects follow their laws")
        print_table(["", ""], [[label, f"{s['hits']} of {s['count']}"] for label, s in found["right_by_law"].items()])
    for title, table in (found["reliability"] or {}).items():
        click.echo(f"\nprobabilities of {title}")
        print_table(["probability", "mean", "there", "share", "95 % interval"], [_bin(entry) for entry in table])
    click.echo()
    rows = []
    for name, effect in found["effects"].items():
        spread = effect["parameters_in_sigma"]
        counts = [effect[key] for key in ("count", "detected", "named", "within", "wrong")]
        rows.append([name, *counts, "" if spread is None else f"{spread['rms']:.1f}"])
    titles = ["hidden by itself", "sessions", "detected", "named", "or within", "wrong", "error in sigma, rms"]
    print_table(titles, rows)
    for key, title in (
        ("parameters_in_sigma", "sizes of what was named"),
        ("kinematics_in_sigma", "joints and lengths"),
    ):
        spread = found[key]
        if spread:
            share = f"{100 * spread['inside_95']:.0f} % of {spread['count']} inside their 95 % intervals"
            click.echo(f"{title}: {share}, {spread['rms']:.2f} sigma rms, worst {spread['worst']:.1f}")
    over, gain, inside = (found["held_out"][key] for key in ("normalised", "gain", "inside"))
    if over:
        click.echo(
            f"held-out tests, where rightly named: {over[1]:.2f} of what is predicted ({over[0]:.2f} to {over[2]:.2f}; "
            f"{inside['hits']} of {inside['count']} between 0.8 and 1.3), {gain[1]:.1f} times less than before"
        )
    if used := found["cost"]:
        memory = used["memory_mb_greatest"]
        click.echo(
            f"a diagnosis took {used['processor_s_mean']:.0f} s of processor time, {used['processor_s_greatest']:.0f} s at the most"
            + (f"; memory {memory:.0f} MB at the most" if memory else "")
            + f"; all of them {used['processor_h']:.2g} hours"
        )
    if found["failures"]:
        click.echo("\nwhat went wrong, worst first:")
        rows = [
            [f["session"], f["seed"], f["recorded"], f["kind"], ", ".join(f["truth"]) or "-", f["said"]]
            for f in found["failures"]
        ]
        print_table(["session", "seed", "recorded", "kind", "hidden (size in limits)", "verdict"], rows)


def _bin(entry: dict[str, Any]) -> list[object]:
    said, count = f"{entry['from']:g} to {entry['to']:g}", f"{entry['hits']} of {entry['count']}"
    if not entry["count"]:
        return [said, "", count, "", ""]
    low, high = (100 * bound for bound in entry["interval"])
    share = f"{100 * entry['share']:.1f} %"
    return [said, f"{entry['mean_probability']:.3f}", count, share, f"{low:.1f} to {high:.1f} %"]
