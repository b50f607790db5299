"""Forms of a cause: all parts, one part, or a common amplitude."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.sources.contract import Parameter

ALIKE = "all struts alike"
"""Label of the form that has one amplitude for all struts."""


@dataclass(frozen=True)
class Part:
    """One form of a cause.

    Attributes:
        label: strut or part; empty for all.
        amplitudes: indices over all sets; summed if `alike`.
    """

    label: str
    amplitudes: tuple[int, ...]
    log_weight: float

    @property
    def alike(self) -> bool:
        """Return whether all struts share one amplitude."""
        return self.label == ALIKE


def parts_of(amplitudes: Sequence[Parameter], sets: int) -> list[Part]:
    """Return forms with log weights; kinds weigh equally, as do a kind's forms."""
    every = tuple(range(len(amplitudes) * sets))
    labels = [p.alone_with for p in amplitudes] * sets
    kinds = [[("", every)]]
    if len(set(labels)) > 1:
        kinds.append([(part, tuple(k for k in every if labels[k] == part)) for part in sorted(set(labels))])
    if sets == 1 and [p.strut for p in amplitudes] == list(range(1, STRUTS + 1)):
        kinds.append([(ALIKE, every)])
    return [Part(label, own, -float(np.log(len(kinds) * len(kind)))) for kind in kinds for label, own in kind]
