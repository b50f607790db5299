"""Time shift between readings and commanded poses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.laws.time_skew import advanced
from dbbstation.sources.contract import Effect, ErrorSource, Motion, Need, Owner, Parameter, Texts
from dbbstation.sources.laws.motion import driven_in_time

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

S_PER_MS = 1e-3

USUAL_MS = 10.0
"""Usual size: one or two readings at some hundred per second."""


class TimeSkew(ErrorSource):
    """A reading is later than its pose by d, so all struts have moved on by x(t + d) - x(t), from cubic splines.

    The fixed ball is stationary. Changes of other sources over d are omitted: parts in a thousand at 10 ms and 1000
    mm/min. A start angle wrong by a is the time a / omega. The figure rotates against the travel, oppositely in both
    directions.

    About a centred ball an exact machine shows no effect; with 0.1 mm of centre offset 10 ms give 0.1 µm. A common
    `servo-lag` is equal with inverted sign, except for shrinkage, so this source models it.
    """

    name = "time-skew"
    belongs_to = Owner.INSTRUMENT
    needs = frozenset({Need.POSE, Need.PATH, Need.TIME})
    looks_ahead = True  # the reading belongs to a later pose
    varies_with = "speed"
    form_uncertainty = 0.05  # clocks drift a little
    texts = Texts(
        what="Readings carry a time, or the turn a starting angle, that is a little off: the instrument filters or "
        "sends late, or the beginning of the turn was found too late.",
        shows="Clockwise and counter-clockwise figures are turned against each other by a small angle. The larger the "
        "machine's own error, the more of it shows; a machine without error shows nothing.",
        confirm="Run one circle at half and at twice the feed: the angle between the directions halves and doubles. "
        "Look up filter time and buffering of the instrument.",
        cure="Switch off the instrument's filter or enter its delay; start recordings from the control's signal; keep "
        "the feed low.",
        equation="reading(t) is that of the pose at t + d: strut error x(t + d) - x(t), nearly d dx/dt",
        origin="Taylor's theorem; the counterpart of a lag that all struts share",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return (
            Parameter("late_ms", "ms", USUAL_MS, "time by which readings were taken after the poses they stand at"),
        )

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        gone, _ = self._gone_on(motion, machine, S_PER_MS * float(values[0]))
        return Effect(strut_mm=gone)

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        _, speed = self._gone_on(motion, machine, S_PER_MS * float(values[0]))
        return Effect(strut_mm=S_PER_MS * speed[:, :, None])

    def stated_mm(self, motion: Motion) -> Floats | None:  # noqa: ARG002
        """Return the usual size [ms], because exact circles do not determine this random effect."""
        return np.array([USUAL_MS])

    def _gone_on(self, motion: Motion, machine: Machine, late_s: float) -> tuple[Floats, Floats]:
        self.require(motion)
        time_s, length, place = driven_in_time(motion, machine)
        gone, speed = advanced(length, time_s, late_s)
        return gone[place], speed[place]
