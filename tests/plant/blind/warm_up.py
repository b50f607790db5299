"""Warm-ups: no two sessions have the same law."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tests.plant.mechanisms.warming import Warming

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.plant.run import Scene


def drawn_warming(rng: np.random.Generator, scene: Scene) -> Callable[[float], Warming]:
    """A law of its own, but for the rise [K]: one stage or two, only while drives run or always, with a break, cooling."""
    first_s = float(np.exp(rng.uniform(np.log(600.0), np.log(6000.0))))
    second_s = first_s * float(rng.uniform(0.1, 0.6)) if rng.random() < 0.4 else None
    idle = float(rng.uniform(0.2, 1.0))
    if rng.random() < 0.2:
        # The machine was warm from earlier work and only cools.
        return lambda rise_k: Warming(0.0, first_s, second_s, start_k=rise_k)
    off_s = _breaks(scene)
    head_start_s = float(rng.uniform(0.0, 600.0))
    return lambda rise_k: Warming(rise_k, first_s, second_s, idle, head_start_s, off_s=off_s)


def _breaks(scene: Scene) -> tuple[tuple[float, float], ...]:
    """Pauses of more than ten minutes between runs: the drives are off then."""
    pairs = zip(scene.slots[:-1], scene.slots[1:], strict=True)
    return tuple((a.end_s, b.start_s) for a, b in pairs if b.start_s - a.end_s > 600.0)
