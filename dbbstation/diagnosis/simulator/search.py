"""Find missing terms: compare, insert, refit, simulate, until stable."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.challenge import challenger, cost
from dbbstation.diagnosis.simulator.fit import near
from dbbstation.diagnosis.simulator.laws import form_uncertainty
from dbbstation.diagnosis.simulator.nodes import noise_of
from dbbstation.diagnosis.simulator.trials import beside
from dbbstation.diagnosis.simulator.work import BudgetSpentError
from dbbstation.inference.bounds import BOUNDS, SIMULATORS
from dbbstation.inference.levels import SURE, SURELY
from dbbstation.inference.read_off import values_of_members
from dbbstation.inference.settle import Beginning, settle
from dbbstation.inference.triangle import rms

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from dbbstation.diagnosis.simulator.candidates import Candidate
    from dbbstation.diagnosis.simulator.nodes import Challenge, Node, Nodes
    from dbbstation.diagnosis.simulator.work import FittedState
    from dbbstation.inference.channel import Channel
    from dbbstation.inference.settle import Settled

RIVAL_SHARE = 0.5
"""Least log posterior of an inserted rival, over the best one's: linear responses to large terms may err by so much."""

STILL = 0.1
"""Largest move of a converged value, in standard uncertainties."""


@dataclass(frozen=True, eq=False)
class SearchOutcome:
    """The end of a search.

    Attributes:
        is_settled: whether all moves are below a tenth of the uncertainty, and no further term is needed.
        withstood: tests in which named laws replaced a curve.
    """

    node: Node
    settled: Settled
    state: FittedState
    residual: np.ndarray
    is_settled: bool
    refuted: Mapping[str, str] = field(default_factory=dict)
    stopped: str = ""
    withstood: tuple[Challenge, ...] = ()


def compared(channel: Channel, progress: Callable[[str], None] = lambda _: None) -> Settled:
    """Compare all candidates, with all initial noise models."""
    return settle(channel, look=False, progress=progress)


def compared_quickly(channel: Channel, beginning: Beginning) -> Settled:
    """Compare quickly from one start, which may miss large effects."""
    beginnings = tuple(dict.fromkeys((beginning, Beginning.EVERYTHING)))
    return settle(channel, look=False, most_expanded=0, thorough=False, beginnings=beginnings)


def search(nodes: Nodes, base: Node, compare: Callable[[Channel], Settled], *, refits: bool = True) -> SearchOutcome:
    """Insert missing terms one by one, and remove unnecessary terms.

    Args:
        refits: whether to refit with own noise until stable; False for held-out rows.
    """
    nodes.challenges.clear()  # results from other rows do not apply
    node, been, refuted, refitted, stopped = base, {base.names}, dict[str, str](), 0, ""
    settled, still, put_in = compare(node.channel), False, node
    try:
        for _ in range(SIMULATORS.rounds):
            wanted: Node | None = challenger(nodes, node, settled)
            more: Mapping[str, str] = {}
            if wanted is None or wanted.names in been:
                wanted, more = _wanted(nodes, node, settled)
            been -= nodes.bettered
            nodes.bettered.clear()
            if wanted is not None and wanted.names not in been:
                been.add(wanted.names)
                put_in = wanted
                without = dict.fromkeys((one.curve for one in nodes.withstood(wanted)), BEATEN)
                settled, node, refuted, refitted = compare(wanted.but_for(without)), wanted, without, 0
                still = False
            elif more:
                refuted |= more
                settled = compare(node.but_for(refuted))
            elif not refits or still or refitted >= BOUNDS.refits:
                break
            else:
                again, before = nodes.again(node, *noise_of(settled)), _said(node, settled)
                settled, node, refitted = compare(again.but_for(refuted)), again, refitted + 1
                still = _still(before, _said(node, settled))
    except BudgetSpentError as error:
        if not refits:
            raise
        stopped = error.what
        if put_in is not node:
            # Rivals of the last inserted term are not yet compared.
            node, settled = put_in, compare(put_in.alone)
    if refits:
        still = still and not stopped and node.names <= settled.best.names
        found = node.fitted.state, node.fitted.residual
        return SearchOutcome(node, settled, *found, still, refuted, stopped, tuple(nodes.withstood(node)))
    state, residual = near(nodes.work, node.fitted, *noise_of(settled))
    return SearchOutcome(node, settled, state, residual, is_settled=True)


REFUTED = "it was put in and refitted, and is not worth it there"
BEATEN = "named terms are in its place, and it does not refute them"
WITHIN = "it is less than what the terms at its port may be off by"
"""Why a term favoured by linear responses is not compared in the end."""


def _wanted(nodes: Nodes, node: Node, settled: Settled) -> tuple[Node | None, Mapping[str, str]]:
    outside = {one.name: one for one in node.outside}
    more = [member.name for member in settled.best.members if member.name in outside]
    if settled.probability(outside) < SURE:
        more = []  # no further term is sure
    small = within_forms(node, settled, more)
    if small and len(small) == len(more):
        return None, dict.fromkeys(small, WITHIN)
    more = [name for name in more if name not in small]
    if more:
        first = max(more, key=settled.best.log_factor)
        # Near a good fit linear responses are correct, so a better term replaces some of its terms.
        displaced = not node.names <= settled.best.names
        together = [nodes.instead(node, [outside[name] for name in more], settled)] if displaced else []
        rivals = (nodes.with_more(node, one, settled) for one in _rivals(node, settled, outside[first]))
        tried = [one for one in (*together, *rivals) if one is not None and not _within_forms_refitted(one, node.names)]
        costs = [cost(nodes, one, settled) for one in tried]
        if not tried or cost(nodes, node, settled) - min(costs) < SURELY:
            return None, dict.fromkeys(more, REFUTED)  # by linear responses only, or the simulation diverges
        best = tried[int(np.argmin(costs))]
        nodes.progress(f"put in {', '.join(best.names - node.names)}")
        return best, {}
    less = [name for name in node.names if name not in settled.best.names]
    return (nodes.without(node, less[0]) if less else None), {}


def within_forms(node: Node, settled: Settled, names: Sequence[str]) -> list[str]:
    """Return members smaller than the slack of other terms at their port."""
    # Real objects depart from forms in any shape. Absorbed parts are excluded. Effects are judged jointly, because
    # similar effects may cancel.
    every = {one.name: one for one in (*node.inside, *node.outside)}
    members = [every[member.name] for member in settled.best.members]
    channel, bank = settled.channel, settled.bank
    alone = bank.base_values(np.zeros(len(channel.residual)))

    def size(of: Sequence[str]) -> float:
        effect = settled.effect(of)
        return rms(effect + channel.base.samples @ (bank.base_values(effect) - alone))

    return _less(members, size, names)


def _within_forms_refitted(node: Node, but_for: Collection[str]) -> list[str]:
    base = node.fitted.columns[:, : len(node.work.model.parameters)]

    def size(of: Sequence[str]) -> float:
        effect = np.sum([node.answers_of(name) @ np.array(node.terms[name][1].amplitudes) for name in of], axis=0)
        return rms(beside(base, effect))

    return _less(node.inside, size, [name for name in node.terms if name not in but_for])


def _less(members: Sequence[Candidate], size: Callable[[Sequence[str]], float], names: Sequence[str]) -> list[str]:
    ports = {one.name: one.term.port for one in members}
    off = {one.name: form_uncertainty(one) * size([one.name]) for one in members}

    def within(some: Sequence[str]) -> bool:
        others = [off[one] for one in off if one not in some and ports[one] == ports[some[0]]]
        return size(some) < math.hypot(*others)

    found = []
    for port in sorted({ports[name] for name in names}):
        own = [name for name in names if ports[name] == port]
        found += own if within(own) else [name for name in own if within([name])]
    return found


def _rivals(node: Node, settled: Settled, first: Candidate) -> Sequence[Candidate]:
    members = [member for member in settled.best.members if member.name in node.names]
    outside = {one.name: one for one in node.outside}
    causes = [cause for cause in settled.causes if cause.name in outside]
    scan = settled.comparison.scan(members, causes)
    worth = {c.name: float(odds) for c, odds in zip(scan.causes, scan.log_odds, strict=True)}
    order = sorted((name for name in worth if name != first.name), key=lambda name: -worth[name])
    enough = [name for name in order if worth[name] > max(RIVAL_SHARE * worth.get(first.name, 0.0), 0.0)]
    return [first, *(outside[name] for name in enough[: BOUNDS.rivals - 1])]


def moves(node: Node, settled: Settled) -> dict[str, float]:
    """Return the greatest move of each term, in standard uncertainties."""
    largest = dict.fromkeys((name for name, _ in _said(node, settled)), 0.0)
    for (name, number), (value, uncertainty) in _said(node, settled).items():
        one, term, _ = node.terms[name]
        before = dict(zip(one.names, term.numbers, strict=True))[number]
        largest[name] = max(largest[name], abs(value - before) / uncertainty)
    return largest


def _said(node: Node, settled: Settled) -> dict[tuple[str, str], tuple[float, float]]:
    members = [member for member in settled.best.members if member.name in node.names]
    found, said = values_of_members(settled, members), dict[tuple[str, str], tuple[float, float]]()
    for of, values in found.items():
        one, term, _ = node.terms[of]
        for k, name in enumerate(one.names):
            # Responses to shapes are linearised about the fitted shape.
            about = term.numbers[k] if k >= len(term.amplitudes) else 0.0
            if values[name].uncertainty > 0.0:
                said[(one.name, name)] = about + values[name].value, values[name].uncertainty
    return said


def _still(
    before: Mapping[tuple[str, str], tuple[float, float]], after: Mapping[tuple[str, str], tuple[float, float]]
) -> bool:
    return before.keys() == after.keys() and all(
        abs(after[key][0] - before[key][0]) < STILL * after[key][1] for key in after
    )
