"""Find the input that best distinguishes two terms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.held import parts
from dbbstation.diagnosis.simulator.nodes import spread_of
from dbbstation.diagnosis.simulator.trials import apart, beside, trial_inputs
from dbbstation.errors import CalibrationError
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.levels import OUT, Verdict

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.simulator.model import TrialInput
    from dbbstation.diagnosis.simulator.nodes import Nodes
    from dbbstation.diagnosis.simulator.search import SearchOutcome
    from dbbstation.diagnosis.simulator.terms import Term
    from dbbstation.inference.read_off import CauseFinding


@dataclass(frozen=True)
class SeparatingInput:
    """A recording that would distinguish two terms.

    Attributes:
        repeats: of the recorded input until the terms are distinguished.
        input: best input in words; None if no tried input is better than the recorded one.
        input_sigmas: standardised difference with this input, for equal length.
    """

    text: str
    terms: tuple[str, str]
    part: str
    sigmas: float
    repeats: int
    input: str | None
    input_sigmas: float
    recorded_sigmas: float


def _text(one: SeparatingInput) -> str:
    first, second = one.terms
    if one.input is not None:
        return (
            f"{first} or {second}: record {one.input}. Their answers then differ by {one.input_sigmas:.2g} standard "
            f"deviations; under the inputs as recorded they differ by {one.recorded_sigmas:.2g}."
        )
    return (
        f"{first} or {second}: their answers differ most in {one.part}, by {one.sigmas:.2g} standard deviations. "
        f"Record inputs as there, {_repeated(one.repeats)}, or larger ones."
    )


def separations(nodes: Nodes, found: SearchOutcome, findings: tuple[CauseFinding, ...]) -> tuple[SeparatingInput, ...]:
    """Return proposals for indistinguishable pairs."""
    settled = found.settled
    base = settled.bank.whitened(settled.channel.base.samples) / settled.noise.innovation
    every, proposals = parts(nodes.work), []
    for pair in _wanted(found, findings)[: BOUNDS.separations]:
        columns = [_column(found, each) for each in pair]
        first, second = (settled.bank.whitened(column) / settled.noise.innovation for column in columns)
        differs = beside(np.column_stack([base, second]), first)
        squares = [float(np.sum(differs[rows] ** 2)) for _, rows in every]
        best = int(np.argmax(squares))
        if squares[best] > 0.0:
            repeats = max(int(np.ceil(OUT**2 / squares[best])), 1)
            trial, sigmas, recorded = _tried(nodes, found, pair)
            about = None if trial is None else trial.about
            one = SeparatingInput(
                "", pair, every[best][0], float(np.sqrt(squares[best])), repeats, about, sigmas, recorded
            )
            proposals.append(replace(one, text=_text(one)))
    return tuple(proposals)


def _wanted(found: SearchOutcome, findings: tuple[CauseFinding, ...]) -> list[tuple[str, str]]:
    laws = {cause.name for cause in found.settled.causes}
    wanted: list[tuple[str, str]] = []
    for one in findings:
        if one.verdict is Verdict.AMBIGUOUS:
            for other in one.ambiguous_with or one.equivalent:
                if other != one.name and (other, one.name) not in wanted and {one.name, other} <= laws:
                    wanted.append((one.name, other))
    return sorted(wanted, key=lambda pair: not found.node.names & set(pair))


def _tried(nodes: Nodes, found: SearchOutcome, pair: tuple[str, str]) -> tuple[TrialInput | None, float, float]:
    trials = trial_inputs(nodes.work.model)
    if not trials:
        return None, 0.0, 0.0
    noise = found.settled.noise.effective * spread_of(nodes.work, found.settled.bank)
    try:
        terms = [_term(found, name) for name in pair]
        sigmas = [apart(nodes.work, trial, found.state, terms, noise) for trial in trials]
    except CalibrationError:  # the budget is spent, or the simulator fails with other inputs
        return None, 0.0, 0.0
    best = int(np.argmax(sigmas))
    return (trials[best] if best else None), sigmas[best], sigmas[0]


def _term(found: SearchOutcome, name: str) -> Term:
    inside = next((term for term in found.state.terms if term.name == name), None)
    if inside is not None:
        return inside
    one = next(one for one in found.node.outside if one.name == name)
    return one.term.with_numbers(found.node.numbers_of(found.settled, one))


def _repeated(repeats: int) -> str:
    if repeats > BOUNDS.repeats:
        return "though no number of repeats will do"
    return f"{repeats} times" if repeats > 1 else "once more"


def _column(found: SearchOutcome, name: str) -> Floats:
    settled, best = found.settled, found.settled.best
    if name in best.names:
        return settled.effect([name])
    cause = next(cause for cause in settled.causes if cause.name == name)
    member = settled.comparison.scan((), [cause]).best[0]
    values = settled.comparison.estimates([member]).values
    return settled.bank.samples(member.columns) @ values
