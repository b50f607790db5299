"""Mismatch: find where measured and simulated values of a table differ, and what the simulation lacks."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

from dbbstation.errors import ArgumentError
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import File, Files, Names, Option, drawing, paths_of, task
from dbbstation.tasks.telling import Telling

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping
    from typing import Unpack

    from numpy.typing import NDArray

    from dbbstation.diagnosis.table.applied import AppliedCorrection
    from dbbstation.diagnosis.table.units import Meaning
    from dbbstation.files.recordings.table_csv import Columns
    from dbbstation.results.mismatch import MismatchResult
    from dbbstation.results.simulator import SimulatorResult
    from dbbstation.tasks.tables import Tabulated
    from dbbstation.tasks.telling import Hooks

    Tables = Files | Columns | Iterable[Columns]
    Variables = str | Mapping[str, Meaning | str | None] | Names
    Uncertainties = str | Mapping[str, float]
else:
    Tables, Variables, Uncertainties = Files, Any, Any

STAGES = {"look": 0, "sets of causes": 8, "held-out part": 15}
STAGES_WHOLE = {"look": 0, "sets of causes": 50}
"""Stages of a comparison with and without the held-out test, and the share of its time that has passed at each begin
[%]."""

SIMULATOR_STAGES = {"refit": 0, "look": 5, "sets of causes": 10, "held-out part": 40}
SIMULATOR_STAGES_WHOLE = {"refit": 0, "look": 5, "sets of causes": 20}
"""The same with a simulator."""

CORRECTED, LEFT = "corrected", "left"
"""Names of the added columns."""


def stages(given: Mapping[str, Any]) -> Mapping[str, int]:
    """Return the stages of the requested comparison."""
    whole = not given.get("held_out", True)
    if given.get("simulator") is None:
        return STAGES_WHOLE if whole else STAGES
    return SIMULATOR_STAGES_WHOLE if whole else SIMULATOR_STAGES


@task("mismatch", label="comparison", stages=stages)
def mismatch(
    data: Annotated[
        Tables,
        Option(
            "CSV files; scripts may give DataFrames, mappings of arrays, or arrays with named fields.",
            kind="argument",
            metavar="DATA.csv...",
            objects=True,
        ),
    ],
    measured: Annotated[str | None, Option("Column of the measured values.", metavar="COLUMN")] = None,
    simulated: Annotated[str | None, Option("Column of the simulated values.", metavar="COLUMN")] = None,
    *,
    simulator: Annotated[
        File | None,
        Option(
            "File of your own simulator, or the name of an installed one. The command runs and refits it, and searches its ports for missing terms.",
            kind="path",
            metavar="model.yaml",
            not_with=("measured", "simulated", "variables", "run", "time", "known", "free", "offset"),
        ),
    ] = None,
    most_runs: Annotated[
        int | None,
        Option(
            "With --simulator: greatest number of simulations [default: as many as run in ten minutes].",
            least=1,
            only_with="simulator",
        ),
    ] = None,
    anew: Annotated[bool, replace(o.ANEW, only_with="simulator")] = False,
    allow: Annotated[
        bool,
        Option(
            "With --simulator: run this simulator from now on, until one of its files changes. A simulator file runs a program.",
            only_with="simulator",
        ),
    ] = False,
    variables: Annotated[
        Variables | None,
        Option(
            "Columns that the difference may follow, each with its unit or kind if its name lacks it [default: all]. NAME:result or NAME=UNIT:result marks a column that results from the simulation and cannot be a cause.",
            metavar="A,B=UNIT,...",
        ),
    ] = None,
    run: Annotated[
        str | None,
        Option("Column with the name of the run [default: each file is a run].", metavar="COLUMN"),
    ] = None,
    time: Annotated[
        str | None,
        Option(
            "Column with the time, or `rows` if the rows are in the order of measuring [default: guessed].",
            metavar="COLUMN",
        ),
    ] = None,
    source_files: o.SourceFiles = (),
    known: Annotated[
        Uncertainties | None,
        Option(
            "Prior standard uncertainty of the parameter whose derivative is in the column d_NAME. The default is the change that moves the simulated value by twice the mismatch.",
            metavar="NAME=U,...",
        ),
    ] = None,
    free: Annotated[
        Names, Option("Parameters without prior knowledge, such as initial states.", metavar="NAME,...")
    ] = (),
    matters: Annotated[
        float | None,
        Option(
            'Smallest effect that matters to you, rms in the unit of the measured values. A "no" excludes effects of this size or more '
            "[default: the residual after the parameters are refitted].",
            metavar="SIZE",
            above=0.0,
        ),
    ] = None,
    apply: Annotated[
        Tables | None,
        Option(
            "File with other rows of the same columns; it needs no measured values. --table then has their corrected simulation and its u.",
            kind="path",
            metavar="OTHER.csv",
            objects=True,
            not_with=("simulator",),
        ),
    ] = None,
    offset: Annotated[bool, Option("Do not fit a constant difference.")] = True,
    held_out: o.HeldOut = True,
    decimal: o.Decimal = None,
    separator: o.Separator = None,
    allowed: Collection[str] | None = None,
    **hooks: Unpack[Hooks],
) -> MismatchResult | SimulatorResult:
    r"""Find where a simulation and a recording differ, in what form, and which physics the simulation lacks.

    A row of the table has one measured value, the simulated one, and all that was known at that moment: joint angles,
    positions, loads, temperatures, the time. Units are at the end of names (x_mm, q1_deg, t_s, oil_temp_c) or in
    --variables. Columns d_NAME are derivatives of the simulated value by a parameter NAME, which is then refitted.

    With --simulator the recordings have inputs and measured outputs, and the command runs your simulator itself. The
    answer names each missing term and its port; --out writes the missing terms as Python code. The user's cache folder
    keeps finished simulations; --anew runs them again. --table writes the corrected simulation.

    \b
    Examples:
      dbbstation mismatch axis.csv --measured measured_mm --simulated simulated_mm
      dbbstation mismatch axis.csv --measured measured_mm --simulated simulated_mm --figure where.svg
      dbbstation mismatch excel.csv --measured y_um --simulated y_sim_um --decimal ,
      dbbstation mismatch arm.csv --measured z_mm --simulated fk_mm --variables q1=deg,q2=deg,temperature --json
      dbbstation mismatch pendulum.csv --simulator pendulum.yaml --allow --out missing.py
      dbbstation mismatch tank.csv --measured level_m --simulated level_sim_m --known valve=0.02 --free level_at_start

    Args:
        allowed: hashes of simulators that may run; None: passing one is permission.

    Returns:
        What was found; `drawing` draws it, and `table` or `code` has the corrected simulation.

    Raises:
        ArgumentError: a value that it does not take, or neither columns nor a simulator.
        InputError: every fault of every file; too few rows.
        StationError: the simulator is not allowed to run.
        CalibrationError: the values are rounded too much for so large a difference.
        StoppedError: `stop` returned True.
    """
    from dbbstation.diagnosis.table.applied import applied
    from dbbstation.diagnosis.table.mismatch import find_mismatch
    from dbbstation.files.formats.number_language import number_language
    from dbbstation.files.own_classes import load_sources
    from dbbstation.results.mismatch import mismatch_result
    from dbbstation.tasks.tables import (
        TableOptions,
        load_rows,
        load_tables,
        stated_uncertainties,
        stated_variables,
    )

    telling = Telling(**hooks)
    numbers = number_language(decimal, separator)
    if simulator is not None:
        from dbbstation.simulators.allowed import require_allowed, simulator_file
        from dbbstation.simulators.loading import load_simulator
        from dbbstation.tasks.mismatch_simulator import with_simulator

        simulator = simulator_file(str(simulator))
        if allowed is not None:
            telling.note(*filter(None, [require_allowed(simulator, allowed, allow=allow)]))
        files: tuple[Any, Any] = data, source_files  # paths, which were checked
        loaded = load_simulator(simulator, *files, numbers)
        return with_simulator(loaded, telling, matters=matters, most=most_runs, hold_out=held_out, keeps=not anew)
    if measured is None or simulated is None:
        name = "measured" if measured is None else "simulated"
        raise ArgumentError(name, "give `measured` and `simulated`, columns of the table, or `simulator`")
    asked = TableOptions(
        measured,
        simulated,
        None if variables is None else stated_variables(variables),
        run,
        time,
        numbers,
        known={} if known is None else stated_uncertainties(known),
        free=tuple(free),
        has_offset=offset,
    )
    tabulated = load_tables(data if isinstance(data, tuple) else (data,), asked)
    telling.note(*tabulated.notes)
    sources, lacking = load_sources(paths_of(source_files), tabulated.table.columns)
    telling.note(*(f"{name} cannot be asked: {why}" for name, why in lacking.items()))
    others = (
        None if apply is None else load_rows(apply if isinstance(apply, tuple) else (apply,), asked, tabulated.table)
    )
    found = find_mismatch(
        tabulated.table, sources, hold_out=held_out, lacking=lacking, matters=matters, progress=telling.stage
    )
    if others is None:
        table = _with_correction(tabulated, found.correction, None)
    else:
        correction = applied(found, others.table, sources)
        telling.note(*others.notes, *_limits_of(correction))
        table = _with_correction(others, correction.values, correction.uncertainty)
    return mismatch_result(found, table=table, drawing=drawing("mismatch_figure", found), notes=tuple(telling.notes))


def _limits_of(correction: AppliedCorrection) -> Iterator[str]:
    if correction.left_out:
        yield f"other rows are not corrected for {', '.join(correction.left_out)}"
    for name, count in correction.beyond.items():
        yield f"`{name}` is beyond the fitted rows in {count} of {len(correction.values)} rows: the correction is no more than a guess there"


def _with_correction(
    tabulated: Tabulated, correction: NDArray[Any], u: NDArray[Any] | None
) -> dict[str, tuple[str | float, ...]]:
    table = tabulated.table
    corrected = table.simulated + correction
    columns: dict[str, tuple[str | float, ...]] = {name: tabulated.columns[name] for name in tabulated.names}
    unit = "".join(f"_{word}" for word in re.findall(r"\w+", table.unit.replace("µ", "u").lower()))
    more = {CORRECTED: corrected, LEFT: table.measured - corrected, f"u_{CORRECTED}": u}
    for name, values in more.items():
        if values is None or not len(values) or all(value != value for value in values.tolist()):  # noqa: PLR0124 - NaN
            continue
        names = (f"{name}{unit}", *(f"{name}{unit}_{k}" for k in range(2, len(columns) + 3)))
        columns[next(one for one in names if one not in columns)] = tuple(values.tolist())
    return columns
