"""Findings on a simulator."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.fit import not_told_apart
from dbbstation.diagnosis.simulator.held import PredictedPart, gains_of, parts, predicted_parts
from dbbstation.diagnosis.simulator.nodes import Nodes, noise_of
from dbbstation.diagnosis.simulator.search import compared, moves, search
from dbbstation.diagnosis.simulator.separate import separations
from dbbstation.diagnosis.simulator.work import AGREE, BudgetSpentError, FittedState, SimulationRuns
from dbbstation.facts.value import Value, finite
from dbbstation.inference.folds import LEAST_PARTS, HeldOutError, refits_without
from dbbstation.inference.left_over import left_over
from dbbstation.inference.levels import Verdict
from dbbstation.inference.levels_of import levels_of
from dbbstation.inference.read_off import Trial, read_off
from dbbstation.inference.triangle import rms

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.simulator.model import Model
    from dbbstation.diagnosis.simulator.nodes import Challenge, Node
    from dbbstation.diagnosis.simulator.search import SearchOutcome
    from dbbstation.diagnosis.simulator.separate import SeparatingInput
    from dbbstation.diagnosis.simulator.terms import Term
    from dbbstation.diagnosis.simulator.work import Run
    from dbbstation.inference.left_over import LeftOver
    from dbbstation.inference.levels import Levels
    from dbbstation.inference.read_off import CauseFinding
    from dbbstation.laws.contract import PortSource


@dataclass(frozen=True)
class RefittedOfSimulator:
    """A parameter of the simulator.

    Attributes:
        shift_over_u: shift in standard uncertainties of the first value; None if unknown.
        confounded: R² on found terms; zero without terms.
    """

    name: str
    unit: str
    stated: float
    refitted: Value
    corrected: Value
    shift: float
    shift_over_u: float | None
    confounded: float
    not_told_apart_from: tuple[str, ...] | None


@dataclass(frozen=True, eq=False)
class SimulatorComparison:
    """The answer on a simulator and its recordings.

    Attributes:
        findings: present or possible terms, present first.
        held_out: None if not tested.
        as_simulated: measured less simulated values at stated parameters, shape (n,).
        nonlinear: departure from linearity in standard uncertainties, by term; nan without budget.
    """

    model: Model
    base: Node
    found: SearchOutcome
    findings: tuple[CauseFinding, ...]
    parameters: tuple[RefittedOfSimulator, ...]
    left: LeftOver
    levels: Levels
    held_out: HeldOutError | None
    as_simulated: Floats
    nonlinear: Mapping[str, float]
    not_asked: Mapping[str, str]
    separations: tuple[SeparatingInput, ...] = ()
    stopped: str = ""

    @property
    def work(self) -> SimulationRuns:
        """Return the number of simulations."""
        return self.base.work

    @property
    def terms(self) -> tuple[Term, ...]:
        """Return inserted terms with values."""
        return self.found.state.terms

    @property
    def is_there(self) -> bool:
        """Return whether the simulator lacks a term, including the next term of an unfinished search."""
        next_in = bool(self.stopped) and bool(self.found.settled.best.members)
        return bool(self.terms) or not self.left.is_noise or next_in

    @property
    def identified(self) -> tuple[CauseFinding, ...]:
        """Return findings that are present and, if tested, predict."""
        return tuple(one for one in self.findings if one.verdict is Verdict.IDENTIFIED)

    @property
    def rms(self) -> tuple[float, float, float]:
        """Return rms errors as simulated, refitted and corrected."""
        every = (self.as_simulated, self.base.fitted.residual, self.found.residual)
        return tuple(rms(rows) for rows in every)  # type: ignore[return-value]  # three of them


def find(
    model: Model,
    run: Run,
    *,
    own: Sequence[PortSource] = (),
    hold_out: bool = True,
    matters: float | None = None,
    progress: Callable[..., None] = lambda *_: None,
) -> SimulatorComparison:
    """Find the terms that a simulator lacks, and their ports.

    Args:
        hold_out: whether to repeat the selection without each part, which takes most of the time.
        matters: size of interest, in the first output's unit; None for the refitted residual.

    Raises:
        CalibrationError: a simulation failed; states its input.
    """
    stated = FittedState(tuple(p.value for p in model.parameters))
    work = SimulationRuns(model, run, np.ones(len(model.outputs)))
    as_simulated = work.residuals([stated])[0]
    if len(model.outputs) > 1:
        work = SimulationRuns(model, run, _scales(work, stated))
        as_simulated = work.residuals([stated])[0]
    nodes = Nodes(work, own, progress)
    base = nodes.base(stated)
    found = search(nodes, base, lambda channel: compared(channel, progress))
    stopped, folds = found.stopped, list[PredictedPart]()
    if hold_out and not stopped:
        try:
            folds.extend(predicted_parts(nodes, base, found, stated, progress))
        except BudgetSpentError as error:
            stopped = error.what
    return _said(nodes, base, found, folds, as_simulated, stopped, matters)


def _scales(work: SimulationRuns, stated: FittedState) -> Floats:
    residual, outputs = work.residuals([stated])[0], len(work.model.outputs)
    noise = []
    for k in range(outputs):
        # Second differences remove smooth parts; the variance of white noise is a sixth of theirs.
        rows = [np.diff(residual[block], 2) for block in work.blocks[k::outputs]]
        noise.append(float(np.sqrt(np.mean(np.square(np.concatenate(rows))) / 6.0)))
    if min(noise) <= 0.0:
        noise = [max(float(np.std(residual[work.blocks[k]])), 1e-300) for k in range(outputs)]
    return np.array(noise) / noise[0]


def _said(
    nodes: Nodes,
    base: Node,
    found: SearchOutcome,
    folds: Sequence[PredictedPart],
    as_simulated: Floats,
    stopped: str,
    matters: float | None,
) -> SimulatorComparison:
    node, settled = found.node, found.settled
    left = left_over(settled)
    refits = refits_without(settled, [rows for _, rows in parts(nodes.work)])
    try:
        nonlinear = _nonlinear(nodes.work, found)
    except BudgetSpentError:
        nonlinear = {term.name: np.nan for term in found.state.terms}
    try:
        not_asked = node.asked[1]
    except BudgetSpentError:
        not_asked = {}
    open_to = {name: one for one in found.withstood if one.log_odds > 0.0 for name in one.names}
    held_out = HeldOutError(tuple(folds)) if len(folds) >= LEAST_PARTS else None
    gains, reference = (None, None) if held_out is None else (gains_of(folds), held_out.as_simulated)
    levels = levels_of(settled, left, gains, matters, reference=reference)
    read = read_off(settled, Trial(gains, refits), levels)
    findings = tuple(_judged(one, found, nonlinear, open_to) for one in read)
    findings = tuple(sorted(findings, key=lambda one: (one.verdict.rank, -one.log_bayes_factor)))
    return SimulatorComparison(
        model=nodes.work.model,
        base=base,
        found=found,
        findings=findings,
        parameters=_parameters(base, found),
        left=left,
        levels=levels,
        held_out=held_out,
        as_simulated=as_simulated,
        nonlinear=nonlinear,
        not_asked=not_asked | dict(found.refuted),
        separations=separations(nodes, found, findings),
        stopped=stopped,
    )


def _judged(
    one: CauseFinding, found: SearchOutcome, nonlinear: Mapping[str, float], open_to: Mapping[str, Challenge]
) -> CauseFinding:
    """Return a finding with the term's values; it is not named if nonlinear or worse than a curve."""
    if one.name not in found.node.terms:
        if one.verdict.rank < Verdict.AMBIGUOUS.rank:
            why = NOT_REACHED if found.stopped else CAME_BACK
            return replace(one, verdict=Verdict.AMBIGUOUS, text=f"It was not put in: {why}.")
        return one
    candidate, term, _ = found.node.terms[one.name]
    values = dict(one.values)
    for name, number in zip(candidate.names, term.numbers, strict=True):
        if name in values:
            values[name] = replace(values[name], value=number)
    one = replace(one, values=values)
    why = _why_open(one.name, found, nonlinear[one.name], open_to.get(one.name))
    if not why or one.verdict.rank >= Verdict.AMBIGUOUS.rank:
        return one
    curves = (open_to[one.name].curve,) if one.name in open_to else ()
    return replace(one, verdict=Verdict.AMBIGUOUS, text=why, ambiguous_with=(*one.ambiguous_with, *curves))


def _why_open(name: str, found: SearchOutcome, nonlinear: float, curve: Challenge | None) -> str:
    farthest = max(moves(found.node, found.settled).items(), key=lambda pair: pair[1], default=("", 0.0))
    if farthest[1] > MOST_ASKED:
        it = "it" if farthest[0] == name else farthest[0]
        return f"Refitted, {it} is {farthest[1]:.1f} standard uncertainties from where the comparison about the refit has it: no verdict."
    if np.isnan(nonlinear):
        return "No simulations were left to test its answer by: no verdict."
    if nonlinear > AGREE:
        return f"True and linear answer to it differ by {100.0 * nonlinear:.0f} %: no verdict."
    if curve is not None:
        return f"A {curve.curve} is more probable by odds of {math.exp(curve.log_odds):.2g}; 19 would refute the name."
    return ""


CAME_BACK = "the search came back to where it had been"
NOT_REACHED = "the simulations that were allowed were spent before"

MOST_ASKED = 2.0
"""Largest distance of a refitted term from the comparison about the refit, in standard uncertainties. Beyond, one case
in twenty, the linear responses do not describe the refit, and no other term is sure."""


def _nonlinear(work: SimulationRuns, found: SearchOutcome) -> dict[str, float]:
    weigh, sigma = noise_of(found.settled)
    fitted, apart = found.node.fitted, {}
    u = _uncertainties(weigh(fitted.columns) / sigma, work.model)
    for name, (_, term, own) in found.node.terms.items():
        worst = 0.0
        for k in range(own.start, own.start + len(term.amplitudes)):
            true = fitted.residual - work.residuals([fitted.state.moved(k, float(u[k]))], strict=False)[0]
            linear = fitted.columns[:, k] * u[k]
            worst = max(worst, float(np.linalg.norm(true - linear)) / max(float(np.linalg.norm(linear)), 1e-300))
        apart[name] = worst if np.isfinite(worst) else np.inf
    return apart


def _parameters(base: Node, found: SearchOutcome) -> tuple[RefittedOfSimulator, ...]:
    weigh, sigma = noise_of(found.settled)
    model, fitted = base.work.model, found.node.fitted
    count = len(model.parameters)
    rows = weigh(fitted.columns) / sigma
    alone, both = _uncertainties(rows[:, :count], model), _uncertainties(rows, model)[:count]
    white = weigh(base.fitted.columns) / sigma
    before = _uncertainties(white, model) * max(rms(weigh(base.fitted.residual)) / sigma, 1.0)
    names = [p.name for p in model.parameters]
    alike = dict(not_told_apart(names, white))
    found_parameters = []
    for k, p in enumerate(model.parameters):
        refitted = Value(float(base.fitted.state.values[k]), float(before[k]), p.unit)
        corrected = Value(float(found.state.values[k]), float(both[k]), p.unit)
        shift, u = corrected.value - refitted.value, refitted.uncertainty
        found_parameters.append(
            RefittedOfSimulator(
                name=p.name,
                unit=p.unit,
                stated=p.value,
                refitted=refitted,
                corrected=corrected,
                shift=shift,
                shift_over_u=finite(shift / u if u > 0.0 else None),
                confounded=float(np.clip(1.0 - (alone[k] / both[k]) ** 2, 0.0, 1.0)) if both[k] > 0.0 else 0.0,
                not_told_apart_from=None if alike.get(p.name) is None else tuple(alike[p.name]),
            )
        )
    return tuple(found_parameters)


def _uncertainties(rows: Floats, model: Model) -> Floats:
    """Return parameters' standard uncertainties for unit white noise, shape (m,)."""
    inverse, norm = model.inverse_information(rows, 1e-14)
    return np.sqrt(np.maximum(np.diag(inverse), 0.0)) / norm
