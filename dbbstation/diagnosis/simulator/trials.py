"""Trial inputs derived from recorded ones, simulated with each of two terms."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.fit import directions_of
from dbbstation.diagnosis.simulator.model import TrialInput
from dbbstation.diagnosis.simulator.work import FittedState, SimulationRuns
from dbbstation.inference.triangle import left_by, rms

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.simulator.model import Model
    from dbbstation.diagnosis.simulator.terms import Term

FACTORS = (0.5, 2.0)
"""Tried sizes and speeds, over the recorded ones."""

PERIODS = (2, 8, 32)
"""Tried numbers of sine periods over a recording: slow, medium, fast."""

QUARTER = 0.25
"""Share of a recording before and after a step."""


def trial_inputs(model: Model) -> list[TrialInput]:
    """Return the longest run's inputs and variations; empty without inputs."""
    run = max(range(len(model.runs)), key=lambda k: len(model.runs[k]))
    recorded = model.runs[run]
    t = recorded.inputs["t"]
    own = {name: values for name, values in recorded.inputs.items() if name != "t" and np.ptp(values) > 0.0}
    if not own:
        return []
    share = (t - t[0]) / (t[-1] - t[0])

    def made(about: str, of: Callable[[Floats], Floats]) -> TrialInput:
        return TrialInput(run, about, {**recorded.inputs, **{name: of(values) for name, values in own.items()}})

    def between(values: Floats, height: Floats) -> Floats:
        return values.min() + np.ptp(values) * height

    found = [made("the inputs as recorded", lambda values: values)]
    for factor in FACTORS:
        found.append(made(f"{factor:g} times the inputs", lambda values, f=factor: f * values))  # type: ignore[misc]  # bound now
        found.append(
            made(
                f"the inputs played {factor:g} times as fast",
                lambda values, f=factor: np.interp((f * share) % 1.0, share, values),  # type: ignore[misc]  # bound now
            )
        )
    found.append(
        made("one step up and down of their whole range", lambda v: between(v, 1.0 * (np.abs(share - 0.5) < QUARTER)))
    )
    for turns in PERIODS:
        period = (t[-1] - t[0]) / turns
        found.append(
            made(
                f"a sine of {period:.3g} s over their whole range",
                lambda v, n=turns: between(v, 0.5 - 0.5 * np.cos(2.0 * np.pi * n * share)),  # type: ignore[misc]  # bound now
            )
        )
    sweep = np.pi * PERIODS[-1] * share**2
    found.append(
        made("a sine over their whole range, from slow to fast", lambda v: between(v, 0.5 - 0.5 * np.cos(sweep)))
    )
    return found


def apart(work: SimulationRuns, trial: TrialInput, state: FittedState, pair: Sequence[Term], noise: Floats) -> float:
    """Return how much of one term's effect, over noise, parameters and the other term cannot fit."""
    model = work.model
    own = [k for k, p in enumerate(model.parameters) if p.run in {None, trial.run}]
    parameters = tuple(replace(p, run=None if p.run is None else 0) for p in (model.parameters[k] for k in own))
    one = SimulationRuns(
        replace(model, parameters=parameters, runs=(model.runs[trial.run],)), work.run, work.scales, trial=trial
    )
    names = {term.name for term in pair}
    others = tuple(term for term in state.terms if term.name not in names)
    base = FittedState(tuple(state.values[k] for k in own), others)
    sides = [FittedState(base.values, (*others, term)) for term in pair]
    rows = one.residuals([base, *sides], strict=False)
    if not all(np.isfinite(row).all() for row in rows):
        return 0.0
    weight = 1.0 / noise[one.output]
    effects = [weight * (rows[0] - row) for row in rows[1:]]
    size = rms(rows[0] - rows[1]) or 1.0
    found = one.answers(base, directions_of(one, base), size)
    columns = np.column_stack([weight[:, None] * found.columns, effects[1]])
    return float(np.linalg.norm(beside(columns, effects[0])))


beside = partial(left_by, rcond=1e-10)
"""Residual of rows after fitting columns that may be nearly equal."""
