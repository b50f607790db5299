"""An effect to be hidden in a session: one physical cause whose size is still open."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.plant.arrays import FloatArray
    from tests.plant.mechanisms.base import Mechanism


@dataclass(frozen=True)
class Effect:
    """One cause, drawn but for its size.

    `make` builds the mechanism from d amplitudes in `unit`; `direction` `(d,)` holds their ratios, the largest 1 in
    size. `most` is the largest amplitude that could happen in a shop. Whoever looks for it finds it on `struts`
    (numbers from 1; none where it is no strut's) or organised by one of `variables`. `keys` name the amplitudes as the
    documentation of the examined program does; empty where its law has other amplitudes. `carriers` are what
    the effect needs beside itself to be there at all.
    """

    name: str
    make: Callable[[FloatArray], Mechanism]
    direction: FloatArray
    unit: str
    most: float
    struts: tuple[int, ...] = ()
    variables: tuple[str, ...] = ()
    keys: tuple[str, ...] = ()
    carriers: tuple[Effect, ...] = ()
    carrier_amplitude: float = 0.0

    def at(self, scale: float) -> Mechanism:
        return self.make(scale * self.direction)

    def carried_by(self) -> list[Mechanism]:
        return [carrier.at(carrier.carrier_amplitude) for carrier in self.carriers]

    def signs(self) -> FloatArray:
        """Signs `(d,)` at which single amplitudes can be tried: a gap is never negative."""
        return np.where(self.direction < 0.0, -1.0, 1.0)
