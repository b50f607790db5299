"""The three answers with tests held out in groups, and the strut on which each class acts."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logsumexp

from dbbstation.inference.detectable import detectable_causes
from dbbstation.inference.levels_of import levels_of
from dbbstation.inference.verdict import SURE

if TYPE_CHECKING:
    from dbbstation.inference.chosen_anew import KnownGains
    from dbbstation.inference.left_over import LeftOver
    from dbbstation.inference.levels import Levels
    from dbbstation.inference.settled import Settled


def levels_by_tests(settled: Settled, left: LeftOver, gains: KnownGains | None) -> Levels:
    """Return the three answers, with the strut, or all struts, on which each class surely acts."""
    anew, reference = (None, None) if gains is None else (gains.anew, gains.of(None).before)
    found = levels_of(settled, left, gains, anew, reference=reference, sizes=detectable_causes(settled))
    follows = tuple(replace(one, where=_place(settled, one.members)) for one in found.follows)
    return replace(found, follows=follows)


def _place(settled: Settled, names: tuple[str, ...]) -> str | None:
    labels = {max(form_probabilities(settled, name).items(), key=lambda one: one[1]) for name in names}
    found = {label if probability >= SURE else "" for label, probability in labels}
    return (found.pop() or None) if len(found) == 1 else None


def form_probabilities(settled: Settled, name: str) -> dict[str, float]:
    """Return the probability of each form of a member, by label, given the other members."""
    cause = next(one for one in settled.causes if one.name == name)
    scan = settled.comparison.scan(settled.best.without(name), [cause])
    worth = logsumexp(scan.weighted, axis=1)
    shares = np.exp(worth - logsumexp(worth))
    found: dict[str, float] = {}
    for variant, share in zip(cause.variants, shares, strict=True):
        found[variant.label] = found.get(variant.label, 0.0) + float(share)
    return found
