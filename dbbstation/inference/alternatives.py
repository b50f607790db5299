"""Find equivalent causes, ambiguous causes of which only one is present, and effects that cancel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.grouped import grouped
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.levels import OUT, SURE
from dbbstation.inference.triangle import ROUNDING, root

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.inference.model_comparison import Cause, Member, ModelComparison, Variant
    from dbbstation.inference.settle import Outcome, Settled


EVEN = 0.5
"""Probability above which an uncertain cause is more probably present than absent."""

EQUIVALENT = 0.999
"""Cosine between two causes' effects, given base and other causes, above which they are equivalent: only 4.5 % of one
is outside the other, which decides for very large effects alone."""


class Alternatives:
    """Sets of equivalent causes, and of ambiguous causes, in a comparison.

    Attributes:
        classes: equivalent causes of each member, the member first.
        ambiguities: results of `ambiguity` by uncertain member.
    """

    def __init__(self, settled: Outcome, of: Iterable[Member]) -> None:
        self._settled, self._comparison = settled, settled.comparison
        self._best, self._posterior = settled.best, settled.posterior
        probability = self._posterior.probability
        self.classes = {member.name: self._class(member) for member in of}
        self.ambiguities = {
            name: self.ambiguity(name) for name, equal in self.classes.items() if probability(equal) < SURE
        }

    def ambiguity(self, name: str) -> tuple[str, ...]:
        """Return alternatives, most probable first: if the named cause is absent, one of these is present."""
        chosen = list(next((equal for equal in self.classes.values() if name in equal), (name,)))
        probability, shares, own = self._posterior.probability, self._posterior.shares, self._posterior.inside([name])
        alone = {}
        for other, places in self._posterior.sets_of.items():
            both = float(shares[places] @ own[places])
            # A cause that is mostly present together with it is no alternative.
            if other not in chosen and both < EVEN * probability([name]):
                alone[other] = probability([other]) - both
        for other in sorted(alone, key=lambda n: -alone[n]):
            if probability(chosen) >= SURE or len(chosen) > BOUNDS.alternatives:
                break
            chosen.append(other)
        return tuple(other for other in chosen if other != name) if probability(chosen) >= SURE else ()

    def _class(self, member: Member) -> tuple[str, ...]:
        others = self._best.without(member.name)
        rivals = [c for c in self._settled.causes if c.name not in self._best.names and not c.setup]
        return (member.name, *(c.name for c in rivals if self._is_alike(member, c, others)))

    def _is_alike(self, member: Member, rival: Cause, others: tuple[Member, ...]) -> bool:
        own = member.variant.columns
        same = [v.columns for v in rival.variants if len(v.columns) == len(own)]
        cosine = max((self._cosine(own, columns, others) for columns in same), default=0.0)
        return cosine > EQUIVALENT and not self._is_decided(member, rival, others, cosine)

    def _is_decided(self, member: Member, rival: Cause, others: tuple[Member, ...], cosine: float) -> bool:
        in_place = self._comparison.scan(others, [rival])
        formulas = np.hypot(member.variant.form_uncertainty, in_place.best[0].variant.form_uncertainty)
        if np.sqrt(1.0 - cosine**2) <= formulas:
            return False
        return self._best.log_factor(member.name) - float(in_place.log_factor[0]) > BOUNDS.negligible

    def _cosine(self, one: Integers, other: Integers, others: tuple[Member, ...]) -> float:
        """Return the least cosine between two causes' spans, given base and other members; 1 means equal effects."""
        products = self._comparison.beside(others, np.concatenate([one, other]))
        size = len(one)
        a, b, across = products[:size, :size], products[size:, size:], products[:size, size:]
        cosines = np.linalg.svd(_inverse_root(a) @ across @ _inverse_root(b), compute_uv=False)
        return float(min(cosines.min(), 1.0)) if len(cosines) else 0.0


def named_already(comparison: ModelComparison, nameless: Sequence[Variant], named: Iterable[Variant]) -> list[bool]:
    """Return, for each form of an unmodelled effect, whether a named cause contains it within the inaccuracy of its formula."""
    found = np.zeros(len(nameless), dtype=bool)
    inexact = (v for v in named if v.form_uncertainty > 0.0 and len(v.columns) <= BOUNDS.amplitudes_alike)
    for size, forms in grouped((len(variant.columns), variant) for variant in inexact).items():
        alike = np.array([k for k, form in enumerate(nameless) if len(form.columns) == size], dtype=np.int64)
        if not len(alike):
            continue
        own = np.array([nameless[k].columns for k in alike])
        other = np.array([form.columns for form in forms])
        products = comparison.beside((), np.concatenate([own.ravel(), other.ravel()]))
        count = len(own)
        place = np.arange(len(products)).reshape(-1, size)
        blocks = products[place[:, :, None], place[:, None, :]]
        whole = np.trace(blocks[:count], axis1=1, axis2=2)
        roots = np.array([_inverse_root(block) for block in blocks[count:]])
        across = products[: count * size, count * size :].reshape(count * size, len(other), size)
        # All pairs of effects and forms together, tens of thousands.
        shown = np.square(np.matmul(across.transpose(1, 0, 2), roots)).sum(axis=2)
        shown = shown.reshape(len(other), count, size).sum(axis=2).T
        apart = np.sqrt(np.maximum(1.0 - shown / np.maximum(whole, 1e-300)[:, None], 0.0))
        found[alike] = (apart <= [form.form_uncertainty for form in forms]).any(axis=1)
    return found.tolist()


def in_place_of(name: str, settled: Outcome, causes: Sequence[Cause]) -> list[Member]:
    """Return the best replacements of a member, each with over half of its log Bayes factor."""
    best = settled.best
    scan = settled.comparison.scan(best.without(name), [cause for cause in causes if cause.name not in best.names])
    enough = max(0.5 * best.log_factor(name), 0.0)
    return [scan.best[k] for k in np.argsort(-scan.log_factor)[: BOUNDS.rivals] if scan.log_factor[k] > enough]


def standing_out(products: Floats, plausible: Floats) -> Floats:
    """Return significances of combinations of plausible amplitudes, ascending, shape (p,).

    Args:
        products: products of a cause's columns, given other causes, over noise, shape (p, p).
        plausible: shape (p,).
    """
    return np.sqrt(np.maximum(np.linalg.eigvalsh(plausible[:, None] * products * plausible), 0.0))


def would_show(significances: Floats) -> bool:
    """Return whether half of a cause's combinations of amplitudes stand out, so that its absence would be seen."""
    return bool(np.mean(significances >= OUT) >= EVEN)


def norm_over_sigma(products: Floats, values: Floats, covariance: Floats) -> float:
    """Return an effect's norm in standard deviations, to first order."""
    norm = root(float(values @ products @ values))
    if norm == 0.0:
        return 0.0
    slope = products @ values / norm
    return norm / float(np.sqrt(np.maximum(slope @ covariance @ slope, 1e-300)))


def _inverse_root(products: Floats) -> Floats:
    value, axes = np.linalg.eigh(products)
    usable = value > ROUNDING * max(float(value[-1]), 1e-300)
    return (axes[:, usable] / np.sqrt(value[usable])) @ axes[:, usable].T


MOST_CANCELS = 0.5
"""Effects cancel if the rms of their sum, over the root of the sum of their mean squares, is below this: three quarters
of the squares vanish. For independent effects the ratio is one."""


@dataclass(frozen=True)
class Cancelling:
    """Effects that cancel each other."""

    rms: Mapping[str, float]
    rms_of_sum: float
    unit: str


def cancelling(effects: Mapping[str, Floats], unit: str, scale: float = 1.0) -> Cancelling | None:
    """If most squares cancel, return the effects that exceed their sum, else None."""
    rms = {name: float(np.std(effect)) for name, effect in effects.items()}
    whole = float(np.std(np.sum(list(effects.values()), axis=0))) if effects else 0.0
    if whole >= MOST_CANCELS * float(np.sqrt(np.sum(np.square(list(rms.values()))))):
        return None
    return Cancelling({name: scale * own for name, own in rms.items() if own > whole}, scale * whole, unit)


def cancelling_of(settled: Settled, unit: str, names: Mapping[str, str] | None = None) -> Cancelling | None:
    """Return cancelling effects among best hypothesis and base parameters, or None.

    Args:
        names: display names by member; effects with equal names are summed. None for the members' names.
    """
    base = settled.channel.base
    shown = {name: name if names is None else names.get(name) or name for name in settled.best.names}
    groups = {of: [name for name in shown if shown[name] == of] for of in sorted(set(shown.values()))}
    effects = {of: settled.effect(members) for of, members in groups.items()}
    parameters = enumerate(zip(base.names, settled.base_values(), strict=True))
    return cancelling(effects | {name: base.samples[:, k] * value for k, (name, value) in parameters}, unit)
