"""Lag of struts behind their commands."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from dbbstation.laws.memory import LoopState, driven, lagged, undone
from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import (
    SMOOTH_MM,
    Effect,
    ErrorSource,
    Motion,
    Need,
    Owner,
    Texts,
    of_each_strut,
    of_own_strut,
)
from dbbstation.sources.laws.motion import driven_in_time, speed_mm_s

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import Parameter

S_PER_MS = 1e-3

OF_SECOND = 0.5
"""Usual relative departure of the second term: a pure delay has half that of a loop of first order."""


STANDING = LoopState(0, 0.0, 0.0, np.zeros((8, STRUTS)))
"""State before a program, at rest."""


class ServoLag(ErrorSource):
    """A strut follows its command as a position loop with gain 1/tau: tau_i dy_i/dt = x_i - y_i.

    The error y - x = -tau dx/dt + tau² d²x/dt² - ... is a lag and a shortened path. A run begins in motion. Negative
    tau is a lead, as by feed-forward. Along straight programs the loop is solved row by row (`laws.memory`); a lead is
    -tau dx/dt.

    To first order a common lag equals `time-skew`. About a centred ball it causes only the shrinkage (v tau)² / 2R: 0.2
    µm at 1000 mm/min, 150 mm and 15 ms; with detected feed-in it is invisible. A fit therefore holds the mean of the
    six times at zero and reports it.
    """

    name = "servo-lag"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    needs = frozenset({Need.POSE, Need.PATH, Need.TIME})
    builds_up = True
    varies_with = "strut-speed"
    form_uncertainty = 0.1  # a drive's lag is a filter with more than one time constant
    # Loops of 1 to 5 m/min/mm lag by 12 to 60 ms, of which feed-forward leaves some tenths: about 5 ms in common, 12 times 1 ms / sqrt(6).
    concealed_times = 12.0
    texts = Texts(
        what="The drives follow their commands late, and not all by the same time: position loops with different "
        "gains, or feed-forward that fits some struts only.",
        shows="An ellipse that lies the other way round in the other direction: half the difference of clockwise and "
        "counter-clockwise runs shows it, half their sum does not. It grows with the feed. A lag that all struts share "
        "only makes the circle smaller, by (v tau)² / 2R, and is otherwise the same as readings taken at a wrong time.",
        confirm="Run one circle at half and at twice the feed: the difference between the directions halves and "
        "doubles. Compare following errors of the six drives on the control's diagnosis page at constant speed: error "
        "divided by speed is the lag.",
        cure="Set the position-loop gains of all struts to the same value and adjust velocity feed-forward; until then "
        "measure and finish at a low feed.",
        equation="actual minus driven length = y - x, tau dy/dt = x - y; nearly -tau dx/dt; tau may be another where a strut "
        "lengthens than where it shortens",
        origin="first-order position loop; radius loss (v tau)² / 2R and the ellipse of unequal gains as in "
        "Kakino, Ihara and Shinohara, Accuracy Inspection of NC Machine Tools by Double Ball Bar Method, 1993",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return of_each_strut("strut_{}_ms", "ms", 1.0, "time by which strut {} is late; negative: it is ahead")

    _more: ClassVar[tuple[tuple[float, float], ...]] = ((1.0, 1.0),)
    """Factors of each six values while a strut shortens, and while it lengthens."""

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        return Effect(strut_mm=self._lag(motion, machine, values)[0])

    def begin(self, motion: Motion, machine: Machine, values: Floats) -> LoopState:  # noqa: ARG002
        self.require(motion)
        return STANDING

    def advance(self, motion: Motion, machine: Machine, values: Floats, state: LoopState) -> tuple[Effect, LoopState]:
        length, time_s = motion.struts(machine).length_mm, np.asarray(motion.time_s)
        lag, _, behind = driven(length, time_s, self._constants_s(values), state)
        return Effect(strut_mm=lag), behind

    def undone(self, motion: Motion, reached: Motion, machine: Machine, values: Floats, state: LoopState) -> Floats:
        commanded, wanted = motion.struts(machine).length_mm, reached.struts(machine).length_mm
        return undone(commanded, wanted, np.asarray(motion.time_s), self._constants_s(values), state)

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        by_constant = self._lag(motion, machine, values)[1]
        own = [of_own_strut(S_PER_MS * np.tensordot(by_constant, more, (1, 0))) for more in self._more]
        return Effect(strut_mm=np.concatenate(own, axis=2))

    def left_open(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        """Return other second terms than tau² d²x/dt², as of loops with several time constants, by strut and direction."""
        lag, by_constant = self._lag(motion, machine, values)
        second = np.sum(self._constants_s(values) * by_constant, axis=1) - lag
        lengthens = np.abs(by_constant[:, 1]) > np.abs(by_constant[:, 0])
        own = [of_own_strut(OF_SECOND * np.where(way, second, 0.0)) for way in (lengthens, ~lengthens)]
        return Effect(strut_mm=np.concatenate(own, axis=2))

    def _constants_s(self, values: Floats) -> Floats:
        """Return time constants while struts shorten, and while they lengthen, shape (2, 6)."""
        return S_PER_MS * np.transpose(self._more) @ values.reshape(-1, STRUTS)

    def _lag(self, motion: Motion, machine: Machine, values: Floats) -> tuple[Floats, Floats]:
        """Return errors, shape (n, 6), and derivatives by time constants, shape (n, 2, 6)."""
        self.require(motion)
        constants = self._constants_s(values)
        if motion.straight:
            return driven(motion.struts(machine).length_mm, np.asarray(motion.time_s), constants, STANDING)[:2]
        time_s, length, place = driven_in_time(motion, machine)
        speed, step, constant = speed_mm_s(time_s, length), np.diff(time_s), constants.ravel()
        # Each direction of travel has its own constant; if both are equal, the sum is one loop.
        speed = np.hstack([np.minimum(speed, 0.0), np.maximum(speed, 0.0)])
        lag, by_constant = lagged(speed, step, np.abs(constant))
        if (constant < 0.0).any():
            ahead, by_ahead = lagged(-speed[::-1], step[::-1], np.abs(constant))
            lag = np.where(constant < 0.0, ahead[::-1], lag)
            by_constant = np.where(constant < 0.0, -by_ahead[::-1], by_constant)
        shape = len(place), 2, STRUTS
        return lag[place].reshape(shape).sum(axis=1), by_constant[place].reshape(shape)


class _ByDirection(ServoLag, law="direction", law_of=ServoLag):
    """The lag is tau + d while a strut lengthens and tau - d while it shortens, because a drive's load depends on direction."""

    _more = ((1.0, 1.0), (-1.0, 1.0))

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        meaning = "time by which strut {} is later than that while it lengthens, and less late while it shortens"
        return (*super().parameters(machine), *of_each_strut("strut_{}_by_direction_ms", "ms", USUAL_MS, meaning))


USUAL_MS = 0.3
"""Usual difference d of a lag from its mean: three tenths of a usual lag."""
