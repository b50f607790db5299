"""Size and place of the largest residual of a fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.inference.remainder import Remainder
    from dbbstation.model.observation import Observation


def where_left(observations: Sequence[Observation], found: Remainder) -> tuple[float, str]:
    """Return a sentence on size [µm] and place of the largest residual."""
    worst = min((found.harmonic, found.run, found.pulse), key=lambda one: one.probability)
    size_um = 1e3 * worst.rms
    if worst is found.harmonic:
        return size_um, f"Most of it comes {worst.place} times per turn, {size_um:.2g} µm rms over all runs."
    run = f"test {observations[worst.place].test} {observations[worst.place].raw.circle.direction}"
    if worst is found.run:
        return size_um, f"Most of it is in {run}, {size_um:.2g} µm rms."
    return size_um, f"Most of it is in {run} about {np.degrees(found.pulse_phase_rad):.0f} degrees, {size_um:.2g} µm."
