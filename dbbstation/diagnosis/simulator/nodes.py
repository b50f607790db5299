"""Simulators with sets of terms put in, each refitted; and the channel in which more terms are compared about such a refit.

Columns of a channel are answers of the simulator with the terms that are in it already. The residual has what these do added back, so
that a hypothesis without them is compared, too.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.candidates import Candidate, candidates
from dbbstation.diagnosis.simulator.fit import SimulatorFit, fit
from dbbstation.diagnosis.simulator.laws import SHARE, curve_answers, discrepancy, form_uncertainty, laws
from dbbstation.diagnosis.simulator.terms import TermForm
from dbbstation.diagnosis.simulator.work import AGREE, FittedState, RanAwayError
from dbbstation.diagnosis.table.data import rounding_of
from dbbstation.inference.channel import Base, Channel, Law
from dbbstation.inference.named_values import named_values

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.simulator.fit import Weigh
    from dbbstation.diagnosis.simulator.laws import Curves
    from dbbstation.diagnosis.simulator.own import PortSource
    from dbbstation.diagnosis.simulator.work import SimulationRuns
    from dbbstation.inference.settled import Settled

MOST_STEPS = 8
"""Steps of a refit with a term put in: it begins at the answer of the linear comparison, and goes on where it is not settled."""


@dataclass(frozen=True, eq=False)
class Node:
    """A simulator with some terms, refitted.

    Attributes:
        work: simulations.
        fitted: to all rows.
        inside: candidates that are put in.
        size: of what the simulator without any term leaves, root mean square: what candidates may explain.
        own: physics of the user's own.
    """

    work: SimulationRuns
    fitted: SimulatorFit
    inside: tuple[Candidate, ...]
    size: float
    own: Sequence[PortSource] = ()

    @property
    def names(self) -> frozenset[str]:
        """Of the terms."""
        return frozenset(one.name for one in self.inside)

    @cached_property
    def outside(self) -> tuple[Candidate, ...]:
        """Candidates that are not put in."""
        work = self.work
        longest = max(work.model.runs, key=len).inputs["t"]
        found = candidates(work.model.ports, work.signals(self.fitted.state), self.own, longest)
        inside = {(one.term.port, one.term.form, one.term.signals, one.term.own) for one in self.inside}
        taken = {one.name for one in self.inside}
        return tuple(
            one
            for one in found
            if one.name not in taken and (one.term.port, one.term.form, one.term.signals, one.term.own) not in inside
        )

    @cached_property
    def asked(self) -> tuple[list[Law], dict[str, str]]:
        """Laws of the candidates outside, and those that cannot be asked, with the reason."""
        return laws(self.work, self.fitted.state, self.outside, self.size, CURVED_MOST)

    @cached_property
    def curves(self) -> Curves:
        """Answers to curves over the signals at the ports of the terms that are put in, by port and signal."""
        found = {
            (one.term.port, one.term.signals[0]): self.answers_of(one.name)
            for one in self.inside
            if one.term.form is TermForm.CURVE
        }
        ports = {one.term.port for one in self.inside if form_uncertainty(one)}
        curves = [
            one for one in (self.outside if ports else ()) if one.term.form is TermForm.CURVE and one.term.port in ports
        ]
        return {**found, **curve_answers(self.work, self.fitted.state, curves, self.size)}

    def answers_of(self, name: str) -> NDArray[np.float64]:
        """What one more of each amplitude of a term does, shape (n, p)."""
        first = len(self.work.model.parameters)
        for one, term in zip(self.inside, self.fitted.state.terms, strict=True):
            if one.name == name:
                return self.fitted.columns[:, first : first + len(term.amplitudes)]
            first += len(term.numbers)
        raise KeyError(name)

    @cached_property
    def channel(self) -> Channel:
        """Channel of everything that may be put in, and of what is."""
        work, fitted, count = self.work, self.fitted, len(self.work.model.parameters)
        parameters = work.model.parameters
        residual = fitted.residual.copy()
        values = np.array(fitted.state.values)
        for k, parameter in enumerate(parameters):
            if parameter.uncertainty is not None:
                residual += fitted.columns[:, k] * (values[k] - parameter.value)
        mine = []
        first = count
        for one, term in zip(self.inside, fitted.state.terms, strict=True):
            columns = fitted.columns[:, first : first + len(term.numbers)]
            first += len(term.numbers)
            residual += columns[:, : len(term.amplitudes)] @ np.array(term.amplitudes)
            mine.append(self._law(one, columns, term.numbers))
        prior = np.array([np.inf if p.uncertainty is None else p.uncertainty for p in parameters])
        names = tuple(f"{run.name}, {output.name}" for run in work.model.runs for output in work.model.outputs)
        return Channel(
            residual=residual,
            unit=work.model.outputs[0].unit,
            blocks=tuple(work.blocks),
            names=names,
            variables=(),
            base=Base(tuple(p.name for p in parameters), fitted.columns[:, :count], prior, np.zeros(count, dtype=bool)),
            laws=(*mine, *self.asked[0]),
            time=work.time,
            static=(),
            least_noise=min(rounding_of(work.measured[rows]) / work.scale[rows.start] for rows in work.blocks),
            levels=work.output if len(work.model.outputs) > 1 else None,
        )

    def _law(self, one: Candidate, columns: NDArray[np.float64], numbers: Sequence[float]) -> Law:
        """Law of a term that is put in: its numbers of all kinds are amplitudes of its answers there."""
        amplitudes, rms = len(one.term.amplitudes), np.sqrt(np.mean(np.square(columns), axis=0))
        usual = self.size / np.maximum(rms, 1e-300)
        usual[amplitudes:] = np.abs(numbers[amplitudes:])
        return Law(
            name=one.name,
            columns=lambda _point: columns,
            plausible=np.maximum(usual, 1e-300),
            parameters=one.names,
            units=one.units,
            log_odds=one.log_odds,
            form_uncertainty=form_uncertainty(one),
            discrepancy=discrepancy(one, self.curves),
        )

    def numbers_of(self, settled: Settled, one: Candidate) -> tuple[float, ...]:
        """Numbers that a comparison about this node gives a candidate in the best hypothesis, or beside it."""
        best = settled.best
        member = next((m for m in best.members if m.cause.name == one.name), None)
        if member is None:
            cause = next(cause for cause in settled.causes if cause.name == one.name)
            member = settled.comparison.scan(best.members, [cause]).best[0]
        others = best.without(one.name)
        found = settled.comparison.estimates([member, *others])
        own = len(member.columns)
        values = named_values(settled, member, found.values[:own], found.covariance[:own, :own])
        if one.tried:
            share = float(np.clip(values[SHARE].value, 0.0, MOST_SHARE))
            return (values[one.names[0]].value * share,)
        return tuple(values[name].value for name in one.names)


SHARES = (1.0, 0.3, 0.1)
"""Shares of what the linear comparison proposes at which a refit is begun, one where the one before runs away."""

MOST_SHARE = 2.0
"""Share of the largest size tried that a fit may begin at: beyond, the answer was not taken."""

CURVED_MOST = 3.0 * AGREE
"""Difference of the answers to two doses, over the answer, beyond which a candidate is not asked: its answer is no column."""


@dataclass(eq=False)
class Nodes:
    """Nodes that were visited, by the names of their terms.

    Attributes:
        work: simulations.
        own: physics of the user's own.
        progress: called with what is being done.
    """

    work: SimulationRuns
    own: Sequence[PortSource] = ()
    progress: Callable[[str], None] = lambda _: None
    known: dict[frozenset[str], Node] = field(default_factory=dict)

    def base(self, start: FittedState) -> Node:
        """The simulator as it is, refitted from several starts."""
        self.progress("refit")
        fitted = fit(self.work, start, several=True)
        size = float(np.sqrt(np.mean(np.square(fitted.residual)))) or 1.0
        node = Node(self.work, fitted, (), size, self.own)
        self.known[node.names] = node
        return node

    def with_more(self, node: Node, one: Candidate, settled: Settled, weigh: Weigh, sigma: float) -> Node | None:
        """A node with one more term, from what a comparison says of it; None where simulations with it run away."""
        names = node.names | {one.name}
        if names not in self.known:
            self.progress(f"refit with {one.name}")
            numbers = np.array(_inside(one, node.numbers_of(settled, one)))
            amplitudes = len(one.term.amplitudes)
            for share in SHARES:
                begun = np.concatenate([share * numbers[:amplitudes], numbers[amplitudes:]])
                term = one.term.with_numbers(begun.tolist())
                state = FittedState(node.fitted.state.values, (*node.fitted.state.terms, term))
                try:
                    self.known[names] = self._fitted(node, state, (*node.inside, one), weigh, sigma)
                    break
                except RanAwayError:
                    continue
        return self.known.get(names)

    def instead(self, node: Node, more: Sequence[Candidate], settled: Settled) -> Node | None:
        """A node with the best set of terms of a comparison, where it lacks some that are in a node and has others.

        None where simulations with it run away.
        """
        names = settled.best.names & node.names | {one.name for one in more}
        if names not in self.known:
            self.progress(f"refit with {', '.join(sorted(names))}")
            terms = zip(node.inside, node.fitted.state.terms, strict=True)
            kept = [(one, term) for one, term in terms if one.name in names]
            new = [one.term.with_numbers(_inside(one, node.numbers_of(settled, one))) for one in more]
            state = FittedState(node.fitted.state.values, (*(term for _, term in kept), *new))
            try:
                self.known[names] = self._fitted(node, state, (*(one for one, _ in kept), *more), *noise_of(settled))
            except RanAwayError:
                return None
        return self.known[names]

    def without(self, node: Node, name: str, weigh: Weigh, sigma: float) -> Node:
        """A node with one term less."""
        names = node.names - {name}
        if names not in self.known:
            self.progress(f"refit without {name}")
            kept = [
                (one, term) for one, term in zip(node.inside, node.fitted.state.terms, strict=True) if one.name != name
            ]
            state = FittedState(node.fitted.state.values, tuple(term for _, term in kept))
            self.known[names] = self._fitted(node, state, tuple(one for one, _ in kept), weigh, sigma)
        return self.known[names]

    def again(self, node: Node, weigh: Weigh, sigma: float) -> Node:
        """The same terms, refitted in other noise."""
        self.known[node.names] = self._fitted(node, node.fitted.state, node.inside, weigh, sigma)
        return self.known[node.names]

    def _fitted(
        self, node: Node, state: FittedState, inside: tuple[Candidate, ...], weigh: Weigh, sigma: float
    ) -> Node:
        fitted = fit(self.work, state, weigh, sigma=sigma, most_steps=MOST_STEPS)
        return replace(node, fitted=fitted, inside=inside)


def _inside(one: Candidate, numbers: Sequence[float]) -> list[float]:
    """Numbers to begin with: what cannot be negative is not."""
    found = list(numbers)
    for k, positive in enumerate(one.positive):
        if positive:
            found[k] = max(found[k], 0.0)
    return found


def noise_of(settled: Settled) -> tuple[Weigh, float]:
    """How rows are made white in the noise that a comparison found, and the standard deviation that they then have."""
    return settled.bank.whitened, settled.noise.innovation


def spread_of(work: SimulationRuns, settled: Settled) -> NDArray[np.float64]:
    """Noise of each output that a comparison found, over that of all rows, shape (o,)."""
    kinds, spread = work.output[settled.channel.kept], settled.bank.spread
    return np.array([float(np.mean(spread[kinds == k])) for k in range(len(work.model.outputs))])
