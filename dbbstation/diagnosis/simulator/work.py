"""Residuals and derivatives of simulations.

Doses h and 2 h give (4 f(h) - f(2h) - 3 f(0)) / 2h, second order [Abramowitz and Stegun, eq. 25.3.4 for one side].
Doses are chosen for an effect of a hundredth of the residual, or less if both responses disagree.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.model import SimulationRequest
from dbbstation.errors import CalibrationError
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.square_root import slices
from dbbstation.inference.triangle import rms

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.diagnosis.simulator.model import Model, SimulationOutcome, TrialInput
    from dbbstation.diagnosis.simulator.terms import Term

    Run = Callable[[Sequence[SimulationRequest]], list[SimulationOutcome]]


class BudgetSpentError(CalibrationError):
    """The simulation budget is spent."""


class RanAwayError(CalibrationError):
    """A simulation's outputs are not finite."""


ANSWER = 0.01
"""Intended rms response to a dose over the residual's rms: nearly linear, but far above an integrator's rounding."""

ROOM = 30.0
"""Largest factor between an accepted response and the intended one."""

AGREE = 0.1
"""Largest relative difference of responses per dose for two doses; second-order extrapolation then leaves about a hundredth."""

UNSEEN = 1e-9
"""Response over the output's spread below which rounding dominates."""


@dataclass(frozen=True)
class FittedState:
    """Values of all fitted parameters."""

    values: tuple[float, ...]
    terms: tuple[Term, ...] = ()

    @property
    def numbers(self) -> Floats:
        """Return parameter values, then values of terms, shape (m,)."""
        return np.array([*self.values, *(number for term in self.terms for number in term.numbers)])

    def with_numbers(self, numbers: Floats) -> FittedState:
        """Return the terms with other values, shape (m,)."""
        own, first, terms = numbers.tolist(), len(self.values), []
        for term in self.terms:
            terms.append(term.with_numbers(own[first : first + len(term.numbers)]))
            first += len(term.numbers)
        return FittedState(tuple(own[: len(self.values)]), tuple(terms))

    def moved(self, place: int, by: float) -> FittedState:
        """Return the state with one parameter changed."""
        numbers = self.numbers
        numbers[place] += by
        return self.with_numbers(numbers)


@dataclass(frozen=True, eq=False)
class Answers:
    """Derivatives by fitted parameters.

    Attributes:
        columns: scaled, shape (n, m).
        curved: relative difference of responses to two doses, shape (m,).
        seen: parameters with a response, shape (m,).
    """

    columns: Floats
    curved: Floats
    seen: Flags


@dataclass(eq=False)
class SimulationRuns:
    """Simulations of a model.

    Attributes:
        scales: sizes of residuals by output, shape (o,).
        doses: suitable doses by parameter.
        trial: inputs of the model's only run, or None.
    """

    model: Model
    run: Run
    scales: Floats
    doses: dict[tuple[str, ...], float] = field(default_factory=dict)
    trial: TrialInput | None = None

    def __post_init__(self) -> None:
        self.blocks = slices(len(run) for run in self.model.runs for _ in self.model.outputs)
        self.time = np.concatenate([run.inputs["t"] for run in self.model.runs for _ in self.model.outputs])
        outputs = [o.name for o in self.model.outputs]
        self.measured = np.concatenate([run.measured[name] for run in self.model.runs for name in outputs])
        self.scale = np.concatenate([np.full(len(run), s) for run in self.model.runs for s in self.scales])
        self.output = np.concatenate([np.full(len(run), k) for run in self.model.runs for k in range(len(outputs))])

    @property
    def size(self) -> int:
        """Return the number of rows of all runs and outputs."""
        return len(self.time)

    def simulated(self, states: Sequence[FittedState], *, strict: bool = True) -> list[Floats]:
        """Return simulated outputs of all rows for each state, shape (n,) each.

        Raises:
            RanAwayError: an output is not finite, if `strict`.
        """
        runs = range(len(self.model.runs))
        asks = [
            SimulationRequest(
                run if self.trial is None else self.trial.run,
                self.model.of_run(run, state.values),
                state.terms,
                trial=self.trial,
            )
            for state in states
            for run in runs
        ]
        answers, found = self.run(asks), []
        for k in range(len(states)):
            own = answers[k * len(runs) : (k + 1) * len(runs)]
            found.append(np.concatenate([answer.outputs.ravel() for answer in own]))
            if strict and not np.isfinite(found[-1]).all():
                where = next(
                    ask for ask, a in zip(asks[k * len(runs) :], own, strict=False) if not np.isfinite(a.outputs).all()
                )
                raise RanAwayError(
                    "the simulation ran away: its outputs are not finite", where=told(self.model, where), remedy=MEND
                )
        return found

    def residuals(self, states: Sequence[FittedState], *, strict: bool = True) -> list[Floats]:
        """Return scaled residuals, shape (n,)."""
        with np.errstate(over="ignore", invalid="ignore"):
            return [(self.measured - values) / self.scale for values in self.simulated(states, strict=strict)]

    def signals(self, state: FittedState) -> dict[str, dict[str, Floats]]:
        """Return port signals of all calls and runs."""
        runs = range(len(self.model.runs))
        answers = self.run(
            [SimulationRequest(k, self.model.of_run(k, state.values), state.terms, records=True) for k in runs]
        )
        return {
            port.name: {
                name: np.concatenate([answer.signals[port.name][name] for answer in answers])
                for name in ("t", *port.signals)
            }
            for port in self.model.ports
        }

    def answers(self, state: FittedState, directions: Sequence[PerturbedParameter], size: float) -> Answers:
        """Return derivatives, from responses to small doses."""
        before = self.residuals([state])[0]
        floor = UNSEEN * float(np.std(self.measured / self.scale))
        wanted = max(ANSWER * size, 100.0 * floor)
        columns, curved = np.zeros((len(before), len(directions))), np.full(len(directions), np.inf)
        seen = np.zeros(len(directions), dtype=bool)
        doses = np.array([self.doses.get(one.key, one.dose) for one in directions])
        open_ = list(range(len(directions)))
        for _ in range(BOUNDS.derivative_rounds):
            if not open_:
                break
            once = self.residuals([directions[k].at(state, doses[k]) for k in open_], strict=False)
            again, good = [], []
            for k, after in zip(open_, once, strict=True):
                moved = rms(before - after) if np.isfinite(after).all() else np.inf
                if wanted / ROOM <= moved <= wanted * ROOM:
                    good.append((k, before - after))
                else:
                    with np.errstate(divide="ignore"):
                        doses[k] *= float(np.clip(wanted / moved, 1e-4, 1e4)) if moved > 0.0 else 1e4
                    again.append(k)
            twice = self.residuals([directions[k].at(state, 2.0 * doses[k]) for k, _ in good], strict=False)
            for (k, first), after in zip(good, twice, strict=True):
                second = before - after
                column = (4.0 * first - second) / (2.0 * doses[k])
                if not np.isfinite(column).all():
                    doses[k] *= 0.1
                    again.append(k)
                    continue
                apart = rms(second / 2.0 - first) / max(abs(doses[k]) * rms(column), 1e-300)
                if apart < curved[k]:
                    columns[:, k], curved[k], seen[k] = column, apart, True
                    self.doses[directions[k].key] = float(doses[k])
                if apart > AGREE:
                    doses[k] *= 0.2
                    again.append(k)
            open_ = again
        return Answers(columns, np.where(seen, curved, 0.0), seen)


@dataclass(frozen=True)
class PerturbedParameter:
    """A perturbed parameter, of the state or of a new term.

    Attributes:
        dose: initial dose; its sign gives the side.
        term: a term outside the state, or None.
    """

    key: tuple[str, ...]
    dose: float
    place: int
    term: Term | None = None

    def at(self, state: FittedState, dose: float) -> FittedState:
        """Return the state changed by the dose."""
        if self.term is None:
            return state.moved(self.place, dose)
        numbers = list(self.term.numbers)
        numbers[self.place] += dose
        return replace(state, terms=(*state.terms, self.term.with_numbers(numbers)))


def told(model: Model, ask: SimulationRequest) -> str:
    """Return a simulation in words."""
    values = ", ".join(f"{key} = {value:.6g}" for key, value in ask.parameters)
    terms = "".join(f"; {term.name}: {', '.join(f'{n:.4g}' for n in term.numbers)}" for term in ask.terms)
    inputs = ask.trial.about if ask.trial else model.runs[ask.run].name
    return f"{inputs} with {values}{terms}"


MEND = "narrow the bounds of the parameters, or mend `simulate` for these values"


def sizes(columns: Mapping[str, Floats]) -> dict[str, float]:
    """Return the greatest absolute values of signals; one for zero."""
    return {name: float(np.abs(values).max(initial=0.0)) or 1.0 for name, values in columns.items()}
