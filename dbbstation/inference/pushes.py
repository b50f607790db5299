"""Count events in time: equal sizes count once, and too many sizes are not events."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from dbbstation.facts.value import Value
from dbbstation.inference.verdict import OUT

if TYPE_CHECKING:
    from collections.abc import Sequence

MOST_PUSHES = 8
"""Most stretches of time with different sizes. Each has three numbers from the residual alone; more could imitate any
residual of a law or noise model."""

ONE_SIZE = 0.999
"""Coverage of the scatter within which pushes have equal size."""


def too_many(sizes: Sequence[Value]) -> str:
    """Return why there are too many sizes for events, else an empty text."""
    distinct = distinct_sizes(sizes)
    if distinct <= MOST_PUSHES:
        return ""
    return (
        f"{len(sizes)} stretches of time would be needed, {distinct} of them of sizes of their own: a form that is not listed, or noise "
        "that comes in pieces, is more likely than so many events."
    )


def within_a_step(sizes: Sequence[Value], step: float) -> str:
    """Return why sizes may be rounding errors, else an empty text.

    The rounding error of slow values, up to half a step, keeps its sign over many rows.

    Args:
        step: zero without rounding.
    """
    if not sizes or any(abs(one.value) - step >= OUT * one.uncertainty for one in sizes):
        return ""
    return f"No stretch of it is larger than the step of {step:.3g} {sizes[0].unit} that is measured in: it may be what was rounded off."


def distinct_sizes(sizes: Sequence[Value]) -> int:
    """Return the number of distinct sizes."""
    return len(sizes) - max(len(most_of_one_size(sizes)) - 1, 0)


def most_of_one_size(sizes: Sequence[Value]) -> list[int]:
    """Return the largest group of sizes equal by chi-square, as ascending indices."""
    order = sorted(range(len(sizes)), key=lambda k: sizes[k].value)
    best: range = range(0)
    for first in range(len(order)):
        while (stop := first + len(best) + 1) <= len(order) and _is_one([sizes[k] for k in order[first:stop]]):
            best = range(first, stop)
    return sorted(order[k] for k in best)


def _is_one(sizes: Sequence[Value]) -> bool:
    mean = pooled(sizes).value
    squares = sum(((one.value - mean) / one.uncertainty) ** 2 for one in sizes)
    return len(sizes) < 2 or squares <= float(chdtri(len(sizes) - 1, 1.0 - ONE_SIZE))  # noqa: PLR2004 - a single size is a group


def pooled(sizes: Sequence[Value]) -> Value:
    """Return the weighted mean with the larger of stated uncertainty and scatter [ISO 13528; Birge 1932]."""
    values, sigmas = (np.array([getattr(one, name) for one in sizes]) for name in ("value", "uncertainty"))
    weights = 1.0 / np.square(sigmas)
    mean = float(weights @ values / weights.sum())
    scatter = float(weights @ np.square(values - mean)) / max(len(values) - 1, 1)
    return Value(mean, float(np.sqrt(max(scatter, 1.0) / weights.sum())), sizes[0].unit)
