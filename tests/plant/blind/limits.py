"""How large an effect must be to be seen: its amplitude over the standard deviation of a fit that knows everything else.

The fit has the 24 kinematic parameters, one shift per mounting and per entry of the CMM sheet, and the bar's length,
all with their usual scatter. Where a recording has no angles, they come from the two edges of the radial feed: what is
late in all runs alike is then late at the edges too and cannot be seen, and each run is early or late by what its
sampling leaves open. With `C` all their columns in units of scatter and of the noise of a sample, an
effect's columns `S` keep the information `SᵀS - SᵀC (1 + CᵀC)⁻¹ CᵀS`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from tests.plant.plan import HOLDER_REPEATABILITY_UM

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tests.plant.arrays import FloatArray
    from tests.plant.linear import LinearSession
    from tests.plant.mechanisms.base import Mechanism
    from tests.plant.noise import Noise
    from tests.plant.plan import Path

TESTABLE_SIGMA = 5.0
BAR_UM = 0.5
FREE_MM = 1.0
"""Scatter that leaves a kinematic parameter free, and keeps finite what circles cannot see."""
FREE_S = 1.0
"""The same for the time by which all runs are late."""


class Limits:
    """The fit of one session, without the effects in question."""

    def __init__(
        self,
        session: LinearSession,
        noise: Noise,
        rate_hz: float,
        base: Sequence[Mechanism] = (),
        *,
        angles: bool = True,
    ) -> None:
        """`base` is what makes the readings change along a circle, so that being late shows."""
        # A sample of the grid stands for several of the recording, or for a part of one.
        self._weight = 1.0 / (noise.slow_um / 1000.0 * np.sqrt(session.samples_per_s / rate_hz))
        plan = session.scene.plan
        holders = {slot.mounting: plan.ball(slot.test.ball).holder for slot in session.scene.slots}
        seats_um = [HOLDER_REPEATABILITY_UM[holder] for holder in holders.values()]
        entries_um = [
            plan.ball(name).uncertainty_um for name in dict.fromkeys(s.test.ball for s in session.scene.slots)
        ]
        scatter_mm = np.concatenate(
            [
                np.full(24, FREE_MM),
                np.repeat(seats_um, 3) / 1000.0,
                np.repeat(entries_um, 3) / 1000.0,
                [BAR_UM / 1000.0],
            ]
        )
        columns = [
            session.kinematic,
            session.shifts(lambda slot: slot.mounting),
            session.shifts(lambda slot: slot.test.ball),
            np.ones((len(self._weight), 1)),
        ]
        if not angles:
            late = session.lateness(base)
            columns += [late, late.sum(axis=1, keepdims=True)]
            each_s = np.full(late.shape[1], _edge_s(plan.path, rate_hz))
            scatter_mm = np.concatenate([scatter_mm, each_s, [FREE_S]])
        self._known = np.concatenate(columns, axis=1) * scatter_mm * self._weight[:, None]
        self._factor = cho_factor(np.eye(self._known.shape[1]) + self._known.T @ self._known)

    def information(self, columns: FloatArray, beside: FloatArray | None = None) -> FloatArray:
        """`(d, d)` about the amplitudes of columns `(m, d)` [mm per unit], with those of others `(m, k)` fitted too."""
        count = columns.shape[1]
        seen = np.concatenate([columns, *([] if beside is None else [beside])], axis=1) * self._weight[:, None]
        known = self._known.T @ seen
        total = seen.T @ seen - known.T @ cho_solve(self._factor, known)
        own, across, others = total[:count, :count], total[count:, :count], total[count:, count:]
        # Others that the fit cannot see by themselves take nothing away.
        return own - across.T @ np.linalg.pinv(others, rcond=1e-10, hermitian=True) @ across

    def sigmas(self, signature: FloatArray, beside: FloatArray | None = None) -> float:
        """How many standard deviations a signature `(m,)` [mm] stands out."""
        return float(np.sqrt(max(self.information(signature[:, None], beside)[0, 0], 0.0)))

    def left_rms_um(self, signature: FloatArray) -> float:
        """What the fit leaves of a signature `(m,)` [mm], root mean square [µm]."""
        seen = signature * self._weight
        left = seen - self._known @ cho_solve(self._factor, self._known.T @ seen)
        return 1000.0 * float(np.sqrt(np.mean((left / self._weight) ** 2)))


def _edge_s(path: Path, rate_hz: float) -> float:
    """Standard deviation [s] of the middle of a run between two edges, where each falls anywhere between two samples.

    A feed that takes two samples or more is interpolated; nothing is then left open that counts.
    """
    feed_in_s = path.feed_in_mm / (path.feed_mm_min / 60.0)
    return 0.0 if feed_in_s * rate_hz >= 2.0 else 1.0 / rate_hz / float(np.sqrt(12.0) * np.sqrt(2.0))
