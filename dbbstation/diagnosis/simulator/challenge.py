"""Evaluate refitted terms, and test named laws against curves."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logsumexp

from dbbstation.diagnosis.simulator.fit import near
from dbbstation.diagnosis.simulator.laws import discrepancy, form_uncertainty
from dbbstation.diagnosis.simulator.nodes import Challenge
from dbbstation.diagnosis.simulator.noise_left import log_probability_of, noise_left
from dbbstation.diagnosis.simulator.terms import TermForm
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.levels import SURELY

if TYPE_CHECKING:
    from dbbstation.diagnosis.simulator.candidates import Candidate
    from dbbstation.diagnosis.simulator.nodes import Node, Nodes
    from dbbstation.inference.model_comparison import Cause, Member
    from dbbstation.inference.settle import Settled

SHARES = (0.0, 0.3, 1.0)
"""Tried inaccuracies of forms, in units of the stated one, from exact to stated."""


def cost(nodes: Nodes, node: Node, settled: Settled) -> float:
    """Return a refitted node's negative log posterior, with its own noise.

    Comparisons estimate noise from linear responses instead. The inaccuracy of forms is marginalised.
    """
    work, fitted, channel = nodes.work, node.fitted, settled.channel
    state, residual = fitted.state, fitted.residual
    if not channel.kept.all():
        own = noise_left(work, residual, fitted.columns, rows=channel)
        state, residual = near(work, fitted, own.whitened, own.noise.innovation)
    off = [np.zeros((len(residual), 0))]
    for one, term in zip(node.inside, state.terms, strict=True):
        columns = discrepancy(one, node.off)
        if columns is not None:
            effect = node.answers_of(one.name) @ np.array(term.amplitudes)
            off.append(columns(effect, (), np.zeros(0)) * form_uncertainty(one))
    beside = np.hstack(off)
    numbers = sum(len(one.names) for one in node.inside)
    odds = sum(one.log_odds for one in node.inside)
    worth = []
    for share in SHARES if beside.shape[1] else SHARES[:1]:
        bank = noise_left(work, residual, fitted.columns, share * beside, channel)
        worth.append(log_probability_of(bank, residual, share * beside, numbers))
    return -odds - float(logsumexp(worth)) + math.log(len(worth))


def challenger(nodes: Nodes, node: Node, settled: Settled) -> Node | None:
    """Return a node with one or two named laws instead of a curve, unless odds of 19 favour the curve.

    A curve only tests a law's form; it is no cause.
    """
    for one in node.inside:
        if one.term.form is not TermForm.CURVE:
            continue
        others = [member for member in settled.best.without(one.name) if member.name in node.names]
        outside = {each.name: each for each in node.outside if each.term.form is not TermForm.CURVE}
        named = _best_named(settled, others, outside)
        if not named:
            continue
        found = nodes.instead(node, [outside[member.name] for member in named], settled, [*others, *named])
        if found is None:
            continue
        odds = cost(nodes, found, settled) - cost(nodes, node, settled)
        if odds < SURELY:
            nodes.challenges.append(Challenge(one.name, frozenset(member.name for member in named), odds))
            return found
    return None


def _best_named(settled: Settled, others: list[Member], outside: dict[str, Candidate]) -> list[Member]:
    def scanned(beside: list[Member], causes: list[Cause]) -> list[tuple[float, Member]]:
        scan = settled.comparison.scan(beside, causes)
        return sorted(zip(scan.log_odds.tolist(), scan.best, strict=True), key=lambda pair: -pair[0])

    causes = [cause for cause in settled.causes if cause.name in outside]
    best: tuple[float, list[Member]] = (0.0, [])
    for worth, member in scanned(others, causes)[: BOUNDS.challenged]:
        rest = [cause for cause in causes if cause.name != member.name]
        more, second = scanned([*others, member], rest)[0] if rest else (-np.inf, member)
        for found in ((worth, [member]), (worth + more, [member, second])):
            if found[0] > best[0]:
                best = found
    return best[1]
