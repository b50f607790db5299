"""What would tell apart terms that these recordings do not: the stretch of the inputs where their answers differ most."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.held import parts
from dbbstation.inference.verdict import OUT, Verdict

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.diagnosis.simulator.answer import SimulatorComparison


@dataclass(frozen=True)
class Separation:
    """What to record to tell two terms apart.

    Attributes:
        text: in words.
        terms: both.
        part: stretch of the recordings in which they differ most.
        sigmas: standard deviations by which they differ there.
        repeats: of that stretch until they are told apart.
    """

    text: str
    terms: tuple[str, str]
    part: str
    sigmas: float
    repeats: int


def separating_inputs(answer: SimulatorComparison) -> list[Separation]:
    """Proposals for each pair of terms that the recordings do not tell apart.

    The answers of both to the inputs that there were are compared beside the parameters: in which stretch of time they differ most, in
    units of noise, and how often that stretch must be repeated until they are `OUT` standard deviations apart.
    """
    found, settled = answer.found, answer.found.settled
    laws = {law.name: law for law in found.node.channel.laws}
    wanted, said = [], set()
    for one in answer.findings:
        if one.verdict is Verdict.AMBIGUOUS:
            for other in one.ambiguous_with or one.equivalent:
                pair = frozenset({one.name, other})
                if len(pair) > 1 and pair not in said and one.name in laws and other in laws:
                    said.add(pair)
                    wanted.append((one.name, other))
    base = settled.bank.whitened(found.node.channel.base.samples) / settled.noise.innovation
    every, proposals = parts(answer.work), []
    for name, other in wanted[:MOST]:
        columns = [_column(answer, each) for each in (name, other)]
        first, second = (settled.bank.whitened(column) / settled.noise.innovation for column in columns)
        apart = _beside(np.column_stack([base, second]), first)
        squares = [float(np.sum(apart[rows] ** 2)) for _, rows in every]
        best = int(np.argmax(squares))
        if squares[best] > 0.0:
            repeats = max(int(np.ceil(OUT**2 / squares[best])), 1)
            text = (
                f"{name} or {other}: their answers differ most in {every[best][0]}, by {np.sqrt(squares[best]):.2g} standard deviations. "
                f"Record inputs as there, {_repeated(repeats)}, or larger ones."
            )
            proposals.append(Separation(text, (name, other), every[best][0], float(np.sqrt(squares[best])), repeats))
    return proposals


MOST = 3
"""Pairs that proposals are made for, at the most."""

MOST_REPEATS = 1000
"""Repeats from which on they are no proposal."""


def _repeated(repeats: int) -> str:
    if repeats > MOST_REPEATS:
        return "though no number of repeats will do"
    return f"{repeats} times" if repeats > 1 else "once more"


def _column(answer: SimulatorComparison, name: str) -> NDArray[np.float64]:
    """Effect of a term over all rows, as large as it is, or as it would be in the best place of another."""
    found = answer.found
    settled, best = found.settled, found.settled.best
    if name in best.names:
        return settled.effect([name])
    cause = next(cause for cause in settled.causes if cause.name == name)
    member = settled.comparison.scan((), [cause]).best[0]
    values = settled.comparison.estimates([member]).values
    return np.asarray(settled.bank.samples(member.columns) @ values)


def _beside(columns: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.float64]:
    norm = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    values = np.linalg.lstsq(columns / norm, wanted, rcond=1e-10)[0]
    return np.asarray(wanted - (columns / norm) @ values)
