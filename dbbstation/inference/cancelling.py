"""Detect effects that cancel each other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.settled import Settled

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
