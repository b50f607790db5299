"""Which terms are missing: compare, put the best one in, refit, ask the ports anew, until nothing moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.fit import near
from dbbstation.diagnosis.simulator.laws import discrepancy, form_uncertainty
from dbbstation.diagnosis.simulator.nodes import noise_of
from dbbstation.diagnosis.simulator.work import BudgetSpentError
from dbbstation.inference.named_values import named_values
from dbbstation.inference.settle import settle
from dbbstation.inference.verdict import SURE

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.diagnosis.simulator.candidates import Candidate
    from dbbstation.diagnosis.simulator.nodes import Node, Nodes
    from dbbstation.diagnosis.simulator.work import FittedState
    from dbbstation.inference.channel import Channel
    from dbbstation.inference.settled import Beginning, Settled

MOST_ROUNDS = 10
"""Times that a term is put in or taken out, or everything refitted, at the most."""

RIVALS = 3
"""Candidates that are each put in and refitted where one is wanted, at the most: the best by the linear comparison."""

RIVAL_SHARE = 0.5
"""Log posterior of a rival by the linear comparison, over that of the best, from which on it is put in: linear answers to a term that
is not small may be off by about as much."""

STILL = 0.1
"""Move, over its standard uncertainty, from which on a value has settled."""


@dataclass(frozen=True, eq=False)
class SearchOutcome:
    """What a search ended at.

    Attributes:
        node: the simulator with what was found, refitted.
        settled: comparison about it.
        state: values, as fitted to the rows of that comparison.
        residual: measured less simulated at that state, shape (n,).
        is_settled: whether everything moved by less than a tenth of its uncertainty in the end, and the comparison wants nothing else.
        stopped: why it ended early; empty where it did not.
    """

    node: Node
    settled: Settled
    state: FittedState
    residual: np.ndarray
    is_settled: bool
    stopped: str = ""


def compared(channel: Channel, progress: Callable[[str], None] = lambda _: None) -> Settled:
    """Compare everything that may be put in, in all kinds of noise."""
    return settle(channel, look=False, static=False, progress=progress)


def compared_quickly(channel: Channel, beginning: Beginning) -> Settled:
    """The same less widely, in noise from one beginning, as where rows are held back."""
    return settle(channel, look=False, static=False, most_expanded=0, thorough=False, beginnings=(beginning,))


def search(nodes: Nodes, base: Node, compare: Callable[[Node], Settled], *, refits: bool = True) -> SearchOutcome:
    """Put in what is missing, one term after the other.

    Args:
        nodes: that were visited.
        base: the simulator as it is.
        compare: everything about a node.
        refits: refit each node in the noise that is found beside it, until nothing moves; False: where rows are held back, which are
            refitted from the node each time.
    """
    node, been, refitted, stopped = base, {base.names}, 0, ""
    settled = compare(node)
    try:
        for _ in range(MOST_ROUNDS):
            wanted = _wanted(nodes, node, settled)
            if wanted is not None and wanted.names not in been:
                been.add(wanted.names)
                settled, node, refitted = compare(wanted), wanted, 0
                continue
            if not refits or (refitted and _moves(node, settled) < STILL) or refitted >= MOST_REFITS:
                break
            again = nodes.again(node, *noise_of(settled))
            settled, node, refitted = compare(again), again, refitted + 1
    except BudgetSpentError as error:
        if not refits:
            raise
        stopped = error.what
    if refits:
        still = not stopped and _moves(node, settled) < STILL and node.names <= settled.best.names
        return SearchOutcome(node, settled, node.fitted.state, node.fitted.residual, still, stopped)
    state, residual = near(nodes.work, node.fitted, *noise_of(settled))
    return SearchOutcome(node, settled, state, residual, is_settled=True)


MOST_REFITS = 4
"""Refits of the same terms in noise found anew, at the most."""


def _wanted(nodes: Nodes, node: Node, settled: Settled) -> Node | None:
    """Node that a comparison wants next: with the term that is worth most, or without one that is not needed; None: this one."""
    weigh, sigma = noise_of(settled)
    outside = {one.name: one for one in node.outside}
    more = [member.cause.name for member in settled.best.members if member.cause.name in outside]
    if settled.averaged(settled.posterior.probability(outside), outside) < SURE:
        more = []  # the recordings do not want anything more for sure
    if more and not node.names <= settled.best.names:
        # Linear answers about a good fit are right: what is better than some of its terms stands in their place.
        better = nodes.instead(node, [outside[name] for name in more], settled)
        if better is not None:
            return better
    if more:
        first = max(more, key=settled.best.log_factor)
        rivals = [nodes.with_more(node, one, settled, weigh, sigma) for one in _rivals(node, settled, outside[first])]
        tried = [one for one in rivals if one is not None]
        if not tried:
            return None  # with any of them the simulation runs away
        costs = [_cost(nodes, one, settled) for one in tried]
        best = tried[int(np.argmin(costs))]
        nodes.progress(f"put in {', '.join(best.names - node.names)}")
        return best
    less = [name for name in node.names if name not in settled.best.names]
    if less:
        return nodes.without(node, less[0], weigh, sigma)
    return None


def _rivals(node: Node, settled: Settled, first: Candidate) -> Sequence[Candidate]:
    """Candidates that may be in the place of one, by the linear comparison beside what is put in already, best first."""
    members = [member for member in settled.best.members if member.cause.name in node.names]
    outside = {one.name: one for one in node.outside}
    causes = [cause for cause in settled.causes if cause.name in outside]
    scan = settled.comparison.scan(members, causes)
    worth = {c.name: float(f) + c.log_prior_odds for c, f in zip(scan.causes, scan.log_factor, strict=True)}
    order = sorted((name for name in worth if name != first.name), key=lambda name: -worth[name])
    enough = [name for name in order if worth[name] > max(RIVAL_SHARE * worth.get(first.name, 0.0), 0.0)]
    return [first, *(outside[name] for name in enough[: RIVALS - 1])]


def _cost(nodes: Nodes, node: Node, settled: Settled) -> float:
    """Less its log posterior, of a node refitted to the rows of a comparison, in its noise [Schwarz's criterion].

    What its forms may be off by is averaged over, by answers to curves.
    """
    weigh, sigma = noise_of(settled)
    state, residual = near(nodes.work, node.fitted, weigh, sigma)
    rows = weigh(residual) / sigma
    numbers = sum(len(one.names) for one in node.inside)
    odds = sum(one.log_odds for one in node.inside)
    off = [np.zeros((len(rows), 0))]
    for one, term in zip(node.inside, state.terms, strict=True):
        columns = discrepancy(one, node.curves)
        if columns is not None:
            effect = node.answers_of(one.name) @ np.array(term.amplitudes)
            off.append(weigh(columns(effect, (), np.zeros(0))) * (form_uncertainty(one) / sigma))
    beside = np.hstack(off)
    products = np.eye(beside.shape[1]) + beside.T @ beside
    towards = beside.T @ rows
    squares = float(rows @ rows - towards @ np.linalg.solve(products, towards))
    spread = float(np.linalg.slogdet(products)[1])
    return 0.5 * squares + 0.5 * spread + 0.5 * numbers * float(np.log(len(rows))) - odds


def _moves(node: Node, settled: Settled) -> float:
    """Largest move that a comparison about a node asks of a number of its terms, over its standard uncertainty."""
    members = [member for member in settled.best.members if member.cause.name in node.names]
    found = settled.comparison.estimates(members) if members else None
    first, moves = 0, [0.0]
    terms = {one.name: (one, term) for one, term in zip(node.inside, node.fitted.state.terms, strict=True)}
    for member in members:
        own = slice(first, first + len(member.columns))
        first = own.stop
        if found is None:
            continue
        one, term = terms[member.cause.name]
        values = named_values(settled, member, found.values[own], found.covariance[own, own])
        for k, name in enumerate(one.names):
            before = term.numbers[k] if k < len(term.amplitudes) else 0.0
            if values[name].uncertainty > 0.0:
                moves.append(abs(values[name].value - before) / values[name].uncertainty)
    return max(moves)
