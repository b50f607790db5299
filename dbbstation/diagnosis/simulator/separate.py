"""What would distinguish terms that these recordings do not: the input under which their answers differ most."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.held import parts
from dbbstation.diagnosis.simulator.nodes import spread_of
from dbbstation.diagnosis.simulator.trials import apart, beside, trial_inputs
from dbbstation.errors import CalibrationError
from dbbstation.inference.verdict import OUT, Verdict

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.diagnosis.simulator.model import TrialInput
    from dbbstation.diagnosis.simulator.nodes import Nodes
    from dbbstation.diagnosis.simulator.search import SearchOutcome
    from dbbstation.diagnosis.simulator.terms import Term
    from dbbstation.inference.read_off import CauseFinding

MOST = 3
"""Pairs that proposals are made for, at the most."""

MOST_REPEATS = 1000
"""Repeats from which on they are no proposal."""


@dataclass(frozen=True, eq=False)
class Separation:
    """What would distinguish two terms.

    Attributes:
        part: stretch of the recordings in which they differ most.
        sigmas: standard deviations by which they differ there.
        repeats: of that stretch until they are distinguished.
        trial: input under which they would differ most; None where the simulator has no inputs, or none of those tried does
            better.
        trial_sigmas: standard deviations by which they would differ under it, in a recording as long.
    """

    terms: tuple[str, str]
    part: str
    sigmas: float
    repeats: int
    trial: TrialInput | None
    trial_sigmas: float
    recorded_sigmas: float

    @property
    def text(self) -> str:
        """In words."""
        first, second = self.terms
        if self.trial is not None:
            return (
                f"{first} or {second}: record {self.trial.about}. Their answers then differ by {self.trial_sigmas:.2g} standard "
                f"deviations; under the inputs as recorded they differ by {self.recorded_sigmas:.2g}."
            )
        return (
            f"{first} or {second}: their answers differ most in {self.part}, by {self.sigmas:.2g} standard deviations. "
            f"Record inputs as there, {_repeated(self.repeats)}, or larger ones."
        )


def separations(nodes: Nodes, found: SearchOutcome, findings: tuple[CauseFinding, ...]) -> tuple[Separation, ...]:
    """Proposals for each pair of terms that the recordings do not distinguish.

    The answers of both are compared beside the parameters: in which stretch of the recordings they differ most, in units of noise, and
    how often that must be repeated until they are `OUT` standard deviations apart; and under which of the trial inputs they would
    differ most, in simulations under these.
    """
    settled = found.settled
    base = settled.bank.whitened(settled.channel.base.samples) / settled.noise.innovation
    every, proposals = parts(nodes.work), []
    for pair in _wanted(found, findings)[:MOST]:
        columns = [_column(found, each) for each in pair]
        first, second = (settled.bank.whitened(column) / settled.noise.innovation for column in columns)
        differs = beside(np.column_stack([base, second]), first)
        squares = [float(np.sum(differs[rows] ** 2)) for _, rows in every]
        best = int(np.argmax(squares))
        if squares[best] > 0.0:
            repeats = max(int(np.ceil(OUT**2 / squares[best])), 1)
            trial, sigmas, recorded = _tried(nodes, found, pair)
            proposals.append(
                Separation(pair, every[best][0], float(np.sqrt(squares[best])), repeats, trial, sigmas, recorded)
            )
    return tuple(proposals)


def _wanted(found: SearchOutcome, findings: tuple[CauseFinding, ...]) -> list[tuple[str, str]]:
    """Pairs of which at least one term was put in first, then those of which none was."""
    laws = {cause.name for cause in found.settled.causes}
    wanted: list[tuple[str, str]] = []
    for one in findings:
        if one.verdict is Verdict.AMBIGUOUS:
            for other in one.ambiguous_with or one.equivalent:
                if other != one.name and (other, one.name) not in wanted and {one.name, other} <= laws:
                    wanted.append((one.name, other))
    return sorted(wanted, key=lambda pair: not found.node.names & set(pair))


def _tried(nodes: Nodes, found: SearchOutcome, pair: tuple[str, str]) -> tuple[TrialInput | None, float, float]:
    """Trial input under which two terms differ most, by how much, and by how much under the inputs as recorded."""
    trials = trial_inputs(nodes.work.model)
    if not trials:
        return None, 0.0, 0.0
    noise = found.settled.noise.effective * spread_of(nodes.work, found.settled)
    try:
        terms = [_term(found, name) for name in pair]
        sigmas = [apart(nodes.work, trial, found.state, terms, noise) for trial in trials]
    except CalibrationError:  # no simulations are left, or the simulator does not bear inputs that nobody recorded
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
    if repeats > MOST_REPEATS:
        return "though no number of repeats will do"
    return f"{repeats} times" if repeats > 1 else "once more"


def _column(found: SearchOutcome, name: str) -> NDArray[np.float64]:
    """Effect of a term over all rows, as large as it is, or as it would be in the best place of another."""
    settled, best = found.settled, found.settled.best
    if name in best.names:
        return settled.effect([name])
    cause = next(cause for cause in settled.causes if cause.name == name)
    member = settled.comparison.scan((), [cause]).best[0]
    values = settled.comparison.estimates([member]).values
    return np.asarray(settled.bank.samples(member.columns) @ values)
