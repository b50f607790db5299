"""`dbbstation mismatch`: any simulation against any recording, given as a table."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dbbstation.cli.effects import (
    LIKELY,
    SURELY_FOUND,
    cancelling_text,
    first_names,
    not_written,
    parts_with_gain,
    residual_text,
)
from dbbstation.cli.figure_option import figure_option, format_of
from dbbstation.cli.number_options import number_language, number_options
from dbbstation.cli.number_types import Finite
from dbbstation.cli.output import echo

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.results.mismatch import EffectResult, MismatchResult


@click.command()
@click.argument("data", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="DATA.csv...")
@click.option("--measured", metavar="COLUMN", help="Column of the measured values.")
@click.option("--simulated", metavar="COLUMN", help="Column of the simulated values.")
@click.option(
    "--simulator",
    type=click.Path(path_type=Path),
    metavar="model.yaml",
    help="Simulator of your own, which is executed: it is refitted, and asked at its ports what it lacks.",
)
@click.option(
    "--most-runs",
    type=click.IntRange(min=1),
    help="With --simulator: simulations that may be run [default: what ten minutes hold].",
)
@click.option(
    "--anew",
    is_flag=True,
    help="With --simulator: run all simulations anew; those run before, of the same files and values, are kept in the user's cache "
    "folder and not run again otherwise.",
)
@click.option(
    "--allow",
    is_flag=True,
    help="With --simulator: run this simulator from now on, until one of its files changes. A simulator file runs a program.",
)
@click.option(
    "--corrected",
    type=click.Path(path_type=Path, dir_okay=False),
    help="With --simulator: write measured, simulated, refitted and corrected values here.",
)
@click.option(
    "--variables",
    metavar="A,B=UNIT,...",
    help="Columns that the difference may follow, each with its unit or kind if its name does not say it; NAME:result or NAME=UNIT:result results "
    "from what is simulated and is no cause [default: all].",
)
@click.option("--run", metavar="COLUMN", help="Column that tells runs apart; several files are several runs anyway.")
@click.option(
    "--time",
    metavar="COLUMN",
    help="Column that says when; `rows`: the rows stand in the order of measuring [default: guessed].",
)
@click.option(
    "--source-file",
    "source_files",
    multiple=True,
    type=click.Path(path_type=Path),
    metavar="FILE.py",
    help="Python file with physics of your own. It is executed. May be given more than once.",
)
@click.option(
    "--known",
    metavar="NAME=U,...",
    help="Standard uncertainty to which parameters of columns d_NAME were known [default: what moves the simulated value twice as "
    "far as it is off].",
)
@click.option("--free", metavar="NAME,...", help="Parameters of which nothing is known, such as initial states.")
@click.option(
    "--matters",
    type=Finite(),
    metavar="SIZE",
    help='Smallest effect that you care about, rms in the unit of the measured values: "no" is answered only where it would have been '
    "found [default: what refitted parameters leave].",
)
@click.option("--no-offset", is_flag=True, help="Let no constant lie between measured and simulated values.")
@click.option("--no-held-out", is_flag=True, help="Leave out the held-out test, which takes most of the time.")
@click.option(
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write the table here, with the corrected simulation as a further column; with --simulator, the missing terms as Python code.",
)
@number_options
@figure_option("Draw what differs here")
@click.option("--force", is_flag=True, help="Overwrite these files.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def mismatch(
    data: tuple[Path, ...],
    *,
    measured: str | None,
    simulated: str | None,
    simulator: Path | None,
    most_runs: int | None,
    anew: bool,
    allow: bool,
    corrected: Path | None,
    variables: str | None,
    run: str | None,
    time: str | None,
    source_files: tuple[Path, ...],
    known: str | None,
    free: str | None,
    matters: float | None,
    no_offset: bool,
    no_held_out: bool,
    decimal: str | None,
    separator: str | None,
    out: Path | None,
    figure: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    r"""Find where a simulation and a recording differ, in what form, and what was left out of the simulation.

    A row of the table is one measured value beside the simulated one, with everything that was known then: joint angles,
    positions, loads, temperatures, the time. Units stand at the end of names (x_mm, q1_deg, t_s, oil_temp_c) or in --variables.
    Columns d_NAME are derivatives of the simulated value by a parameter NAME, which is then fitted anew.

    With --simulator the recordings have inputs and measured outputs, and the program runs your simulator itself: it says at which
    of its ports which term is missing.

    \b
    Examples:
      dbbstation mismatch run.csv --measured measured_mm --simulated model_mm
      dbbstation mismatch day1.csv day2.csv --measured y_um --simulated y_sim_um --figure where.svg
      dbbstation mismatch excel.csv --measured y_um --simulated y_sim_um --decimal ,
      dbbstation mismatch arm.csv --measured z_mm --simulated fk_mm --variables q1=deg,q2=deg,temperature --json
      dbbstation mismatch run.csv --simulator model.yaml --out missing.py --figure before_after.svg
      dbbstation mismatch tank.csv --measured level_m --simulated level_sim_m --known valve=0.02 --free level_at_start
    """
    from dbbstation.cli.output import print_result, say
    from dbbstation.cli.progress import stage_bar
    from dbbstation.cli.provenance import provenance
    from dbbstation.files.atomic import refuse_existing, write_bytes
    from dbbstation.files.provenance import refuse_existing_table, write_table
    from dbbstation.files.recordings.table_csv import table_csv
    from dbbstation.tasks.mismatch import STAGES, STAGES_WHOLE, require_size
    from dbbstation.tasks.mismatch import mismatch as compared
    from dbbstation.tasks.tables import stated_uncertainties, stated_variables

    numbers = number_language(decimal, separator) if decimal or separator else None
    _refuse_mixed(
        simulator,
        {"--measured": measured, "--simulated": simulated, "--variables": variables, "--run": run, "--time": time}
        | {"--known": known, "--free": free, "--no-offset": no_offset or None},
        {"--most-runs": most_runs, "--corrected": corrected, "--anew": anew or None, "--allow": allow or None},
    )
    require_size(matters)
    if simulator is not None:
        from dbbstation.cli.mismatch_simulator import mismatch_with_simulator, refuse_unallowed

        refuse_unallowed(simulator, allow=allow)
        mismatch_with_simulator(
            data,
            simulator,
            source_files,
            numbers,
            matters=matters,
            most_runs=most_runs,
            hold_out=not no_held_out,
            keeps=not anew,
            out=out,
            corrected=corrected,
            figure=figure,
            force=force,
            as_json=as_json,
        )
        return
    if measured is None or simulated is None:
        raise click.UsageError("give --measured and --simulated, columns of the table, or --simulator")
    if out is not None:
        refuse_existing_table(out, force=force)
    if figure is not None:
        refuse_existing(figure, force=force)
    with stage_bar("comparison", STAGES_WHOLE if no_held_out else STAGES) as progress:
        result = compared(
            data,
            measured,
            simulated,
            variables=stated_variables(variables) if variables else None,
            run=run,
            time=time,
            source_files=source_files,
            known_u=stated_uncertainties(known) if known else None,
            free=tuple(name.strip() for name in free.split(",")) if free else (),
            has_offset=not no_offset,
            matters=matters,
            hold_out=not no_held_out,
            numbers=numbers,
            progress=progress,
            say=lambda text: say(f"note: {text}"),
        )
    offered = result.levels.correction is not False
    if out is not None and offered:
        write_table(out, table_csv(list(result.table), list(result.table.values())), provenance(), force=force)
        result = replace(result, out=str(out))
    if figure is not None and result.drawing is not None:
        write_bytes(figure, result.drawing(format_of(figure)), force=force)
        result = replace(result, figure=str(figure))
    if as_json:
        print_result(result)
    else:
        _print(result)
    if out is not None and not offered:
        raise not_written(out, result.levels)


def _refuse_mixed(simulator: Path | None, of_tables: Mapping[str, object], of_simulators: Mapping[str, object]) -> None:
    """Refuse options of the other kind of recordings."""
    given = [name for name, value in (of_simulators if simulator is None else of_tables).items() if value is not None]
    if given:
        what = (
            "belongs to --simulator" if simulator is None else "belongs to a table: model.yaml says it for a simulator"
        )
        raise click.UsageError(f"{given[0]} {what}")


def _print(result: MismatchResult) -> None:
    from dbbstation.cli.output import print_table

    unit, held_out = result.unit, result.held_out_rms
    _print_first(result)
    echo("\n".join((*result.sentences(), "")))
    print_table(
        ["variable", "kind", "unit", "from", "to"],
        [[v.name, v.kind, v.unit or "none", f"{v.low:.5g}", f"{v.high:.5g}"] for v in result.variables],
    )
    echo()
    _print_whether(result)
    there = [f for f in result.findings if f.verdict in SURELY_FOUND]
    equivalent = {name for f in there for name in f.equivalent}
    likely = [f for f in result.findings if f.verdict == "ambiguous" and f.probability >= LIKELY]
    likely = [f for f in likely if f.name not in equivalent]
    there += likely
    if there:
        echo()
        _print_findings(there, unit)
    if result.cancelling:
        echo(f"\n{cancelling_text(result.cancelling)}")
    _print_parameters(result)
    if held_out:
        echo(
            f"\nheld-out error: {held_out.as_simulated:.3g} as simulated, {held_out.before:.3g} refitted, "
            f"{held_out.after:.3g} {unit} rms corrected; over {len(held_out.folds)} parts, everything chosen anew "
            "without each of them"
        )
    elif any(f.verdict == "identified" for f in there):
        echo("\nheld-out parts were not asked for: whether what is identified predicts other rows was not tested.")
    echo()
    _print_left(result)
    for verdict in ("not-testable", "ruled-out"):
        names = [f.name for f in result.findings if f.verdict == verdict]
        if names:
            echo(f"{verdict}: {first_names(names)}")
    if result.next:
        echo("\nmeasure next:")
        for step in result.next:
            echo(f"  {step.text}")


def _print_first(result: MismatchResult) -> None:
    """What is wrong with the answer as a whole."""
    unit, held_out = result.unit, result.held_out_rms
    if held_out and held_out.worse:
        echo(
            f"Held-out rows are predicted worse than as simulated: {held_out.after:.3g} corrected, {held_out.as_simulated:.3g} "
            f"{unit} rms as simulated.\n".replace("  ", " ")
        )
    if result.stopped:
        echo(f"Ended early: {result.stopped}. This is the best answer so far; fewer columns (--variables) take less.\n")


def _print_whether(result: MismatchResult) -> None:
    """Print existence, size, noise and leading variable of a mismatch."""
    unit, noise, rms = result.unit, result.noise, result.residual_rms
    offset = result.offset
    if offset and offset.significant:
        echo(f"Measured less simulated is {offset.in_words} on average; this is fitted and is not counted below.")
    if not result.mismatch:
        echo(f"No mismatch: what differs, {rms.before:.3g} {unit} rms, is noise.".replace("  ", " "))
    else:
        echo(f"There is a mismatch: {rms.before:.3g} {unit} rms, of which {rms.after:.3g} {unit} is not explained.")
    fitted = (
        "" if noise.measured_in_order else "; fitted jointly, since nothing says in which order the rows were measured"
    )
    alike = f", {noise.rows_as_one:.3g} rows count as one" if noise.rows_as_one > 1.0 else ""
    if noise.degrees_of_freedom:
        alike += f", long tails (Student's t, {noise.degrees_of_freedom:g} degrees of freedom)"
    if noise.grows_with:
        alike += f", its variance grows with {noise.grows_with}"
    echo(f"noise of one row: {noise.sigma:.3g} {unit}{alike}{fitted}")
    if result.led_by:
        led = ", ".join(
            f"{s.variable} {100 * s.share:.0f} % ({100 * s.lost:.0f} %)" for s in result.led_by[:MOST_LEADING]
        )
        echo(f"led by (of all that is explained, what follows it alone; in brackets what is lost without it): {led}")


MOST_LEADING = 4
"""Variables that are said to lead a mismatch, at the most."""


def _print_findings(there: Sequence[EffectResult], unit: str) -> None:
    from dbbstation.cli.output import print_table

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
        echo(f"\n{f.name}")
        values = ", ".join(f"{name} {value.in_words}" for name, value in f.values.items())
        if values and len(f.values) <= MOST_VALUES:
            echo(f"  {values}")
        echo(f"  {f.text}")


MOST_TOLD = 12
"""Effects from which on only those that are certain are printed in full."""

MOST_VALUES = 6
"""Values of an effect that are printed; those of a curve say little by themselves, and are in the JSON."""


def _print_parameters(result: MismatchResult) -> None:
    parameters = result.parameters[0 if result.offset is None else 1 :]
    if not parameters:
        return
    echo("\nparameters of the simulation, fitted anew:")
    for p in parameters:
        before, after = p.before.in_words, p.after.in_words
        echo(f"  {p.name}: {before} alone, {after} beside what was found; R² {p.confounded:.2f} with it")
        if p.far:
            echo(f"    {TOO_FAR_STATED if p.stated else TOO_FAR}")


TOO_FAR = (
    "It moves the simulated value more than twice as far as that was off: simulate anew with the new value, since the derivative "
    "may not hold so far."
)
TOO_FAR_STATED = (
    "It is more than three of its stated standard uncertainties away: check what was stated, and simulate anew."
)


def _print_left(result: MismatchResult) -> None:
    echo(residual_text(result.left, result.unit))
    if not result.second_start_agrees:
        odds = result.second_start_log_odds
        echo(f"A search that begins with nothing ends at another set of effects, of log odds {odds:+.0f} to this one.")
