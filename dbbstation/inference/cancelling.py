"""Effects that cancel: each exceeds their sum."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.settled import Settled

MOST_CANCELS = 0.5
"""Root mean square of all effects together, over the root of the sum of their mean squares, below which they cancel each other:
three quarters of the squares are gone. Of effects that have nothing to do with each other it is one."""


@dataclass(frozen=True)
class Cancelling:
    """Effects that cancel each other."""

    rms: Mapping[str, float]
    rms_of_sum: float
    unit: str


def cancelling(effects: Mapping[str, Floats], unit: str, scale: float = 1.0) -> Cancelling | None:
    """Return effects above their sum if most squares cancel, else None."""
    rms = {name: float(np.std(effect)) for name, effect in effects.items()}
    whole = float(np.std(np.sum(list(effects.values()), axis=0))) if effects else 0.0
    if whole >= MOST_CANCELS * float(np.sqrt(np.sum(np.square(list(rms.values()))))):
        return None
    return Cancelling({name: scale * own for name, own in rms.items() if own > whole}, scale * whole, unit)


def cancelling_of(settled: Settled, unit: str, names: Mapping[str, str] | None = None) -> Cancelling | None:
    """Return cancelling effects of the best hypothesis and parameters of the base, or None.

    Args:
        names: display names by member; equal ones are summed. None: own names.
    """
    base = settled.channel.base
    shown = {name: name if names is None else names.get(name) or name for name in settled.best.names}
    groups = {of: [name for name in shown if shown[name] == of] for of in sorted(set(shown.values()))}
    effects = {of: settled.effect(members) for of, members in groups.items()}
    parameters = enumerate(zip(base.names, settled.base_values(), strict=True))
    return cancelling(effects | {name: base.samples[:, k] * value for k, (name, value) in parameters}, unit)
