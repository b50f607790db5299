"""Find equivalent causes, and ambiguous causes of which only one is present."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.hypotheses import NEGLIGIBLE
from dbbstation.inference.triangle import RANK, root
from dbbstation.inference.verdict import SURE

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.inference.hypotheses import Hypothesis, Posterior
    from dbbstation.inference.model_comparison import Cause, Member, ModelComparison, Variant

EVEN = 0.5
"""Probability above which an uncertain cause is more probably present than absent."""

EQUIVALENT = 0.999
"""Cosine between two causes' effects, given base and other causes, above which they are equivalent: only 4.5 % of one
is outside the other, which decides for very large effects alone."""


class Alternatives:
    """Sets of equivalent causes, and of ambiguous causes, in a comparison.

    Args:
        form_uncertainty: relative inaccuracy of a member's formula.

    Attributes:
        classes: equivalent causes of each member, the member first.
        ambiguities: results of `ambiguity` by uncertain member.
    """

    def __init__(
        self,
        comparison: ModelComparison,
        causes: Sequence[Cause],
        posterior: Posterior,
        best: Hypothesis,
        form_uncertainty: Callable[[Member], float],
        of: Iterable[Member],
    ) -> None:
        self._comparison, self._causes, self._best = comparison, causes, best
        self._form_uncertainty = form_uncertainty
        self._inside, self._weights, self._place = _inclusions(posterior)
        self.classes = {member.name: self._class(member) for member in of}
        self.ambiguities = {
            name: self.ambiguity(name) for name, equal in self.classes.items() if self.probability(equal) < SURE
        }

    def probability(self, names: Iterable[str]) -> float:
        """Return the probability that at least one of the causes is present."""
        columns = [self._place[name] for name in names if name in self._place]
        # Rounding can make a partial sum exceed the whole.
        return min(1.0, float(self._weights @ self._inside[:, columns].any(axis=1))) if columns else 0.0

    def ambiguity(self, name: str) -> tuple[str, ...]:
        """Return alternatives, most probable first: if the named cause is absent, one of these is present."""
        chosen = list(next((equal for equal in self.classes.values() if name in equal), (name,)))
        own = self._inside[:, self._place[name]] if name in self._place else np.zeros(len(self._weights), dtype=bool)
        both = (self._weights * own) @ self._inside
        every = self._weights @ self._inside
        # A cause that is mostly present together with it is no alternative.
        alone = {
            other: float(every[k] - both[k])
            for other, k in self._place.items()
            if other not in chosen and both[k] < EVEN * self.probability((name,))
        }
        for other in sorted(alone, key=lambda n: -alone[n]):
            if self.probability(chosen) >= SURE or len(chosen) > BOUNDS.alternatives:
                break
            chosen.append(other)
        return tuple(other for other in chosen if other != name) if self.probability(chosen) >= SURE else ()

    def _class(self, member: Member) -> tuple[str, ...]:
        others = self._best.without(member.name)
        rivals = [c for c in self._causes if c.name not in self._best.names and not c.setup]
        return (member.name, *(c.name for c in rivals if self._is_alike(member, c, others)))

    def _is_alike(self, member: Member, rival: Cause, others: tuple[Member, ...]) -> bool:
        own = member.variant.columns
        same = [v.columns for v in rival.variants if len(v.columns) == len(own)]
        cosine = max((self._cosine(own, columns, others) for columns in same), default=0.0)
        return cosine > EQUIVALENT and not self._is_decided(member, rival, others, cosine)

    def _is_decided(self, member: Member, rival: Cause, others: tuple[Member, ...], cosine: float) -> bool:
        in_place = self._comparison.scan(others, [rival])
        formulas = np.hypot(self._form_uncertainty(member), self._form_uncertainty(in_place.best[0]))
        if np.sqrt(1.0 - cosine**2) <= formulas:
            return False
        return self._best.log_factor(member.name) - float(in_place.log_factor[0]) > NEGLIGIBLE

    def _cosine(self, one: Integers, other: Integers, others: tuple[Member, ...]) -> float:
        """Return the least cosine between two causes' spans, given base and other members; 1 means equal effects."""
        products = self._comparison.beside(others, np.concatenate([one, other]))
        size = len(one)
        a, b, across = products[:size, :size], products[size:, size:], products[:size, size:]
        cosines = np.linalg.svd(_inverse_root(a) @ across @ _inverse_root(b), compute_uv=False)
        return float(min(cosines.min(), 1.0)) if len(cosines) else 0.0


def named_already(
    comparison: ModelComparison, nameless: Sequence[Variant], named: Iterable[tuple[Variant, float]]
) -> list[bool]:
    """Return, for each form of an unmodelled effect, whether a named cause contains it within the inaccuracy of its formula.

    Args:
        named: forms of named causes, with their relative inaccuracy.
    """
    found = np.zeros(len(nameless), dtype=bool)
    by_size: dict[int, list[tuple[Integers, float]]] = {}
    for variant, share in named:
        if share > 0.0 and len(variant.columns) <= MOST_ALIKE:
            by_size.setdefault(len(variant.columns), []).append((variant.columns, share))
    for size, forms in by_size.items():
        alike = np.array([k for k, form in enumerate(nameless) if len(form.columns) == size], dtype=np.int64)
        if not len(alike):
            continue
        own = np.array([nameless[k].columns for k in alike])
        other = np.array([columns for columns, _ in forms])
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
        found[alike] = (apart <= [share for _, share in forms]).any(axis=1)
    return found.tolist()


MOST_ALIKE = 3
"""Most amplitudes of an effect that is compared with forms of named causes: a shift in space has three. With 1 a bumped
jig is ambiguous with a step over time in two of two sessions; with 6 four sessions do not change."""


def in_place_of(name: str, comparison: ModelComparison, causes: Sequence[Cause], best: Hypothesis) -> list[Member]:
    """Return the best replacements of a member, each with over half of its log Bayes factor."""
    scan = comparison.scan(best.without(name), [cause for cause in causes if cause.name not in best.names])
    enough = max(0.5 * best.log_factor(name), 0.0)
    return [scan.best[k] for k in np.argsort(-scan.log_factor)[: BOUNDS.rivals] if scan.log_factor[k] > enough]


def standing_out(products: Floats, plausible: Floats) -> Floats:
    """Return significances of combinations of plausible amplitudes, ascending, shape (p,).

    Args:
        products: products of a cause's columns, given other causes, over noise, shape (p, p).
        plausible: shape (p,).
    """
    return np.sqrt(np.maximum(np.linalg.eigvalsh(plausible[:, None] * products * plausible), 0.0))


def norm_over_sigma(products: Floats, values: Floats, covariance: Floats) -> float:
    """Return an effect's norm in standard deviations, to first order."""
    norm = root(float(values @ products @ values))
    if norm == 0.0:
        return 0.0
    slope = products @ values / norm
    return norm / float(np.sqrt(np.maximum(slope @ covariance @ slope, 1e-300)))


def _inclusions(posterior: Posterior) -> tuple[Flags, Floats, dict[str, int]]:
    top = max(posterior.weights.values())
    sets = [(key, weight) for key, weight in posterior.weights.items() if weight > top - NEGLIGIBLE]
    place = {name: k for k, name in enumerate(sorted(set().union(*(key for key, _ in sets))))}
    inside = np.zeros((len(sets), len(place)), dtype=bool)
    for row, (key, _) in enumerate(sets):
        inside[row, [place[name] for name in key]] = True
    weights = np.exp(np.array([weight for _, weight in sets]) - top)
    return inside, weights / weights.sum(), place


def _inverse_root(products: Floats) -> Floats:
    value, axes = np.linalg.eigh(products)
    usable = value > RANK * max(float(value[-1]), 1e-300)
    return (axes[:, usable] / np.sqrt(value[usable])) @ axes[:, usable].T
