"""Find a mismatch with a simulator in the loop."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dbbstation.diagnosis.simulator.answer import find
from dbbstation.diagnosis.simulator.model import SimulationRequest
from dbbstation.files.csv_rows import table_csv
from dbbstation.results.simulator import SimulationsRun, simulator_result
from dbbstation.simulators.code import missing_code
from dbbstation.simulators.running import MOST_SECONDS, Runs
from dbbstation.tasks.declare import drawing

if TYPE_CHECKING:
    from dbbstation.diagnosis.simulator.answer import SimulatorComparison
    from dbbstation.results.simulator import SimulatorResult
    from dbbstation.simulators.loading import LoadedSimulator
    from dbbstation.tasks.telling import Telling


def with_simulator(
    loaded: LoadedSimulator, telling: Telling, *, matters: float | None, most: int | None, hold_out: bool, keeps: bool
) -> SimulatorResult:
    """Compare a simulator with its recordings."""
    model = loaded.model
    with Runs(loaded, most=most, keeps=keeps) as runs:
        values = [parameter.value for parameter in model.parameters]
        one_s = runs.allow([SimulationRequest(k, model.of_run(k, values)) for k in range(len(model.runs))])
        limit = f"{runs.most} are allowed at the most"
        if most is None:
            limit = f"{MOST_SECONDS / 60.0:.0f} minutes are allowed, which about {runs.most} fit into"
        telling.note(f"a simulation takes {one_s:.2g} s, {limit} (--most-runs)")

        def told(text: str, done: int = 0, of: int = 0) -> None:
            left = runs.left_s
            spent = f"{text}, {runs.ran} of {runs.most} simulations, {left:.0f} s at the most left" if left else text
            telling.stage(spent, done, of)

        answer = find(model, runs, own=loaded.own, hold_out=hold_out, matters=matters, progress=told)
    return replace(
        simulator_result(answer, SimulationsRun(runs.ran, runs.most, one_s, runs.found)),
        code=missing_code(answer),
        rows_csv=_corrected(answer),
        drawing=drawing("simulator_figure", answer),
    )


def _corrected(answer: SimulatorComparison) -> str:
    """Return a table with run, time, and the measured, simulated, refitted and corrected values of each output."""
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
