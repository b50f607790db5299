"""Refitted simulators with terms, and channels linearised about them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.candidates import Candidate, candidates
from dbbstation.diagnosis.simulator.fit import SimulatorFit, fit
from dbbstation.diagnosis.simulator.laws import (
    OFF,
    SHARE,
    departing,
    departures,
    discrepancy,
    form_uncertainty,
    law_of_term,
    laws,
    of_unit_size,
)
from dbbstation.diagnosis.simulator.noise_left import channel_of, noise_left
from dbbstation.diagnosis.simulator.work import FittedState, RanAwayError
from dbbstation.inference.bank import alike
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.channel import Base, Law
from dbbstation.inference.read_off import named_values
from dbbstation.inference.square_root import slices
from dbbstation.inference.triangle import rms

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.simulator.fit import Weigh
    from dbbstation.diagnosis.simulator.laws import Departures
    from dbbstation.diagnosis.simulator.terms import Term
    from dbbstation.diagnosis.simulator.work import SimulationRuns
    from dbbstation.inference.bank import Bank
    from dbbstation.inference.channel import Channel
    from dbbstation.inference.model_comparison import Member
    from dbbstation.inference.settle import Settled
    from dbbstation.laws.contract import PortSource


@dataclass(frozen=True, eq=False)
class Node:
    """A simulator with some terms, after a refit.

    Attributes:
        size: rms without terms, an upper bound of effects.
    """

    work: SimulationRuns
    fitted: SimulatorFit
    inside: tuple[Candidate, ...]
    size: float
    own: Sequence[PortSource] = ()

    @property
    def names(self) -> frozenset[str]:
        """Return the terms' names."""
        return frozenset(one.name for one in self.inside)

    @cached_property
    def terms(self) -> dict[str, tuple[Candidate, Term, slice]]:
        """Return inserted candidates by name, with the fitted term and its columns."""
        terms, first = self.fitted.state.terms, len(self.work.model.parameters)
        own = slices((len(term.numbers) for term in terms), first)
        return {one.name: (one, term, place) for one, term, place in zip(self.inside, terms, own, strict=True)}

    @cached_property
    def outside(self) -> tuple[Candidate, ...]:
        """Return candidates that are not inserted."""
        work = self.work
        longest = max(work.model.runs, key=len).inputs["t"]
        found = candidates(work.model.ports, work.signals(self.fitted.state), self.own, longest)
        what = attrgetter("port", "form", "signals", "own")
        inside = {what(one.term) for one in self.inside}
        return tuple(one for one in found if one.name not in self.names and what(one.term) not in inside)

    @cached_property
    def asked(self) -> tuple[list[Law], dict[str, str]]:
        """Return laws of candidates that are not inserted, and reasons against the remaining ones."""
        return laws(self.work, self.fitted.state, self.outside, self.size)

    @cached_property
    def off(self) -> Departures:
        """Return the slack of inserted terms: curves, lags, stick-slip."""
        found = {
            departing(one): of_unit_size([self.answers_of(one.name)]) for one in self.inside if one.term.form in OFF
        }
        ports = {one.term.port for one in self.inside if form_uncertainty(one)}
        others = [one for one in self.outside if one.term.form in OFF and one.term.port in ports] if ports else []
        return {**found, **departures(self.work, self.fitted.state, others, self.size)}

    def answers_of(self, name: str) -> Floats:
        """Return responses to a term, shape (n, p)."""
        _, term, own = self.terms[name]
        return self.fitted.columns[:, own][:, : len(term.amplitudes)]

    @cached_property
    def channel(self) -> Channel:
        """Return the channel of all terms."""
        return self._channel(self.off, self.asked[0])

    @cached_property
    def alone(self) -> Channel:
        """Return the channel of inserted terms without rivals and slack, which needs no simulation."""
        return self._channel({}, ())

    def _channel(self, off: Departures, others: Sequence[Law]) -> Channel:
        work, fitted, count = self.work, self.fitted, len(self.work.model.parameters)
        parameters = work.model.parameters
        residual = fitted.residual.copy()
        values = np.array(fitted.state.values)
        for k, parameter in enumerate(parameters):
            if parameter.uncertainty is not None:
                residual += fitted.columns[:, k] * (values[k] - parameter.value)
        mine = []
        for one, term, own in self.terms.values():
            columns = fitted.columns[:, own]
            residual += columns[:, : len(term.amplitudes)] @ np.array(term.amplitudes)
            mine.append(self._law(one, columns, term.numbers, off))
        prior = np.array([np.inf if p.uncertainty is None else p.uncertainty for p in parameters])
        base = Base(tuple(p.name for p in parameters), fitted.columns[:, :count], prior, np.zeros(count, dtype=bool))
        return channel_of(work, residual, base, (*mine, *others))

    def but_for(self, refuted: Collection[str]) -> Channel:
        """Return the channel without some candidates."""
        laws_left = tuple(law for law in self.channel.laws if law.name not in refuted)
        return replace(self.channel, laws=laws_left)

    def _law(self, one: Candidate, columns: Floats, numbers: Sequence[float], off: Departures) -> Law:
        amplitudes, rms = len(one.term.amplitudes), np.sqrt(np.mean(np.square(columns), axis=0))
        usual = self.size / np.maximum(rms, 1e-300)
        usual[amplitudes:] = np.abs(numbers[amplitudes:])
        return law_of_term(
            one,
            columns=lambda _point: columns,
            plausible=np.maximum(usual, 1e-300),
            parameters=one.names,
            units=one.units,
            discrepancy=discrepancy(one, off),
        )

    def numbers_of(self, settled: Settled, one: Candidate, beside: Sequence[Member] | None = None) -> tuple[float, ...]:
        """Return a comparison's estimates for a candidate.

        Args:
            beside: other members; None for the best hypothesis.
        """
        beside = settled.best.members if beside is None else beside
        others = [m for m in beside if m.name != one.name]
        member = next((m for m in beside if m.name == one.name), None)
        if member is None:
            cause = next(cause for cause in settled.causes if cause.name == one.name)
            member = settled.comparison.scan(others, [cause]).best[0]
        values = named_values(settled, *settled.comparison.estimated([member, *others])[0])
        if one.tried:
            share = float(np.clip(values[SHARE].value, 0.0, MOST_SHARE))
            return (values[one.names[0]].value * share,)
        return tuple(values[name].value for name in one.names)


SHARES = (1.0, 0.3, 0.1)
"""Starting values of a refit over the linear estimates: first the share with the least residual, then the others if it fails."""

MOST_SHARE = 2.0
"""Largest starting value over the largest simulated size; beyond, the response is unknown."""


@dataclass(frozen=True)
class Challenge:
    """A test of named laws against a curve.

    Attributes:
        log_odds: in favour of the curve, with all costs.
    """

    curve: str
    names: frozenset[str]
    log_odds: float


@dataclass(eq=False)
class Nodes:
    """Refitted nodes, by terms.

    Attributes:
        bettered: terms for which a better minimum was found later.
    """

    work: SimulationRuns
    own: Sequence[PortSource] = ()
    progress: Callable[[str], None] = lambda _: None
    known: dict[frozenset[str], Node] = field(default_factory=dict)
    begun: set[tuple[frozenset[str], frozenset[str]]] = field(default_factory=set)
    bettered: set[frozenset[str]] = field(default_factory=set)
    challenges: list[Challenge] = field(default_factory=list)

    def withstood(self, node: Node) -> list[Challenge]:
        """Return challenges whose named laws are in a node."""
        return [one for one in self.challenges if one.names <= node.names and one.curve not in node.names]

    def base(self, start: FittedState) -> Node:
        """Return the refitted simulator without terms."""
        self.progress("refit")
        fitted = fit(self.work, start, several=True)
        size = rms(fitted.residual) or 1.0
        node = Node(self.work, fitted, (), size, self.own)
        self.known[node.names] = node
        return node

    def with_more(self, node: Node, one: Candidate, settled: Settled) -> Node | None:
        """Return a node with one more term; None if it diverges."""
        names = node.names | {one.name}
        if names not in self.known:
            self.progress(f"refit with {one.name}")
            there = [member for member in settled.best.members if member.name in node.names]
            numbers = np.array(_inside(one, node.numbers_of(settled, one, there)))
            for state in self._beginnings(node, one, numbers):
                try:
                    found = self._fitted(node, state, (*node.inside, one), _left(node) / BETTER)
                except RanAwayError:
                    continue
                if found is not None:
                    self.known[names] = found
                    break
        return self.known.get(names)

    def _beginnings(self, node: Node, one: Candidate, numbers: Floats) -> list[FittedState]:
        amplitudes, states = len(one.term.amplitudes), []
        for share in SHARES:
            term = one.term.with_numbers([*(share * numbers[:amplitudes]), *numbers[amplitudes:]])
            states.append(FittedState(node.fitted.state.values, (*node.fitted.state.terms, term)))
        left = [_rms(rows) for rows in self.work.residuals(states, strict=False)]
        return [states[int(k)] for k in np.argsort(left) if np.isfinite(left[int(k)])]

    def instead(
        self, node: Node, more: Sequence[Candidate], settled: Settled, beside: Sequence[Member] | None = None
    ) -> Node | None:
        """Return a node with other terms; None if it diverges.

        Args:
            beside: inserted members; None for the best hypothesis's.
        """
        beside = settled.best.members if beside is None else beside
        names = frozenset(member.name for member in beside) & node.names | {one.name for one in more}
        kept = [(one, term) for one, term, _ in node.terms.values() if one.name in names]
        new = [one.term.with_numbers(_inside(one, node.numbers_of(settled, one, beside))) for one in more]
        state = FittedState(node.fitted.state.values, (*(term for _, term in kept), *new))
        return self._known_or_begun(node, state, (*(one for one, _ in kept), *more))

    def without(self, node: Node, name: str) -> Node:
        """Return a node without a term."""
        kept = [(one, term) for one, term, _ in node.terms.values() if one.name != name]
        state = FittedState(node.fitted.state.values, tuple(term for _, term in kept))
        return self._known_or_begun(node, state, tuple(one for one, _ in kept)) or node

    def _known_or_begun(self, node: Node, state: FittedState, inside: tuple[Candidate, ...]) -> Node | None:
        """Return the better of a known node and a new start; None if it diverges."""
        names = frozenset(one.name for one in inside)
        place = node.names, names
        known = self.known.get(names)
        if place in self.begun:
            return known
        self.begun.add(place)
        self.progress(f"refit with {', '.join(sorted(names))}" if names else "refit")
        try:
            found = self._fitted(node, state, inside)
        except RanAwayError:
            return known
        if found is not None and (known is None or _left(found) < BETTER * _left(known)):
            self.known[names] = found
            if known is not None:
                self.bettered.add(names)
        return self.known.get(names)

    def again(self, node: Node, weigh: Weigh, sigma: float) -> Node:
        """Return the node refitted with other noise."""
        self.known[node.names] = replace(node, fitted=fit(self.work, node.fitted.state, weigh, sigma=sigma))
        return self.known[node.names]

    def _fitted(
        self, node: Node, state: FittedState, inside: tuple[Candidate, ...], most: float = np.inf
    ) -> Node | None:
        """Refit unweighted, then repeatedly with the refit's noise until stable."""
        # A residual above `most`, a wrong minimum, returns None.
        fitted, before = fit(self.work, state), None
        if _rms(fitted.residual) > most:
            return None
        for _ in range(BOUNDS.noises):
            bank = noise_left(self.work, fitted.residual, fitted.columns)
            if before is not None and alike(bank.noise, before):
                break
            before = bank.noise
            fitted = fit(self.work, fitted.state, bank.whitened, sigma=before.innovation)
        return replace(node, fitted=fitted, inside=inside)


BETTER = 0.9
"""Largest ratio of residuals of a different, better minimum to the known one; other noise alone gives about equal
residuals."""


def _left(node: Node) -> float:
    return _rms(node.fitted.residual)


def _rms(values: Floats) -> float:
    with np.errstate(over="ignore", invalid="ignore"):
        return rms(values)


def _inside(one: Candidate, numbers: Sequence[float]) -> list[float]:
    found = list(numbers)
    for k, positive in enumerate(one.positive):
        if positive:
            found[k] = max(found[k], 0.0)
    return found


def noise_of(settled: Settled) -> tuple[Weigh, float]:
    """Return the whitening and standard deviation of a comparison's noise."""
    return settled.bank.whitened, settled.noise.innovation


def spread_of(work: SimulationRuns, bank: Bank) -> Floats:
    """Return outputs' relative noise, shape (o,)."""
    kinds, spread = work.output[bank.channel.kept], bank.spread
    return np.array([float(np.mean(spread[kinds == k])) for k in range(len(work.model.outputs))])
