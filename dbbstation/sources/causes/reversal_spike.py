"""Sticking of struts at reversal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.compiled import compiled, inlined
from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import (
    MM_PER_UM,
    SMOOTH_MM,
    Effect,
    ErrorSource,
    Motion,
    Need,
    Owner,
    Parameter,
    Texts,
    of_each_strut,
    of_own_strut,
)
from dbbstation.sources.laws.motion import TURNED_MM, since_turning_in_time
from dbbstation.sources.laws.unlike_struts import of_own_lengths

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

DECAY_S = (0.03, 0.06, 0.12, 0.25, 0.5, 1.0)
"""Tried time constants of the position loop [s]."""

DECAY_MM = tuple(float(f"{decay:.2g}") for decay in np.geomspace(0.0005, 0.8, 12))
"""Tried decay lengths [mm]: spikes that decay in 0.05 to 0.5 s, on circles of 100 to 150 mm at 500 to 2500 mm/min."""


RISE = 1.1
"""Travel over which a spike rises, over its height; 1 is full sticking. With 2, abrupt spikes of 2 to 8 µm were
estimated a third too small, or missed in two of seven sessions; with 1.2 and 1.1 all were detected."""


class ReversalSpike(ErrorSource):
    """A reversing strut sticks, and the position loop corrects it: -s a (1 - exp(-d / c|a|)) exp(-sqrt(d / l)).

    d is the travel since the turning point, s the new direction. The position loop reduces the error as exp(-t / T) at
    the time t since then (`_InTime`). For d = A t^2 / 2 this is exp(-sqrt(d / l)) with l = A T^2 / 2, which needs no
    clock. The length l changes with the square of the feed, and with the acceleration A at the turning point.

    The rise limits the lag to the drive's motion; c = 1 is full sticking. With c = `RISE` the sum of travel and error
    is monotonic and can be compensated. Near a = 0 the error is proportional to a.

    A run has no spike before its first turning point. A straight path reverses at its extreme row, a smooth path
    between rows (`laws.motion`). The remainder of a spike decays over c|a| after the next reversal. Reversals of less
    than a micrometre do not count.
    """

    name = "reversal-spike"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    needs = frozenset({Need.POSE, Need.PATH})
    varies_with = "strut-speed-sign"
    form_uncertainty = 0.3  # sticking differs from reversal to reversal
    texts = Texts(
        what="A strut sticks for a moment when it turns from growing to shrinking or back, until the position loop has "
        "raised the motor's torque by twice the friction.",
        shows="A short spike behind the place where one strut turns round, not where X or Y does, and one of the opposite "
        "sign at the other end of its travel. In the other direction it lies on the other side of that place with the "
        "same sign. It fades within some degrees, where backlash stays.",
        confirm="Record the following error of that strut on the control's oscilloscope while it turns round; repeat the "
        "circle at another feed: the spike changes, backlash does not.",
        cure="Adjust the control's friction (quadrant) compensation for that strut; look after lubrication and seals. A "
        "negative amplitude is a friction compensation that is set too large.",
        equation="actual minus driven length = -s a (1 - exp(-d / 1.1|a|)) exp(-sqrt(d / l)), d the travel since the strut "
        "turned round, s its new direction; or exp(-t / T) instead, t the time since then",
        origin="stick motion of a drive at reversal, as in Kakino, Ihara and Shinohara, Accuracy Inspection of NC "
        "Machine Tools by Double Ball Bar Method, 1993; faded as a position loop of first order does in "
        "time, d = A t^2 / 2 behind the turning point",
    )

    _power = 0.5
    """Exponent of the decay variable over its constant."""

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        heights = of_each_strut("strut_{}_um", "µm", 2.0, "height of the spike of strut {}; positive: it stays behind")
        meaning = "travel of a strut over which its spike falls to 37 %, all struts alike"
        return (*heights, Parameter("decay_mm", "mm", 0.02, meaning, DECAY_MM))

    def _clock(self, motion: Motion) -> Floats | None:  # noqa: ARG002 - this law needs no clock
        """Return times of rows, shape (n,); None if spikes decay with travel."""
        return None

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        return Effect(strut_mm=self._along(motion, machine, values)[0])

    def begin(self, motion: Motion, machine: Machine, values: Floats) -> Floats:  # noqa: ARG002
        self.require(motion)
        return _NOTHING

    def advance(self, motion: Motion, machine: Machine, values: Floats, state: Floats) -> tuple[Effect, Floats]:
        spike, _, _, behind = self._straight(motion, machine, values, state)
        return Effect(strut_mm=spike), behind

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        _, by_height, by_length = self._along(motion, machine, values)
        own = of_own_strut(MM_PER_UM * by_height)
        return Effect(strut_mm=np.concatenate([own, by_length[:, :, None]], axis=2))

    def left_open(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        """Return changes of the effect if each strut has its own decay constant, and if its spikes of a direction rise abruptly."""
        since, fading = self._since(motion, machine)
        height, constant = _sizes(values)
        at_once = -np.sign(since) * height * np.exp(-((fading / constant) ** self._power))
        risen = at_once - self._along(motion, machine, values)[0]
        lengths = of_own_lengths(self, motion, machine, values).strut_mm
        ways = [of_own_strut(risen * (way * since > 0.0)) for way in (1.0, -1.0)]
        return Effect(strut_mm=np.concatenate([np.asarray(lengths), *ways], axis=2))

    def _along(self, motion: Motion, machine: Machine, values: Floats) -> tuple[Floats, Floats, Floats]:
        self.require(motion)
        if motion.straight:
            return self._straight(motion, machine, values, _NOTHING)[:3]
        since, fading = self._since(motion, machine)
        spike, by_height, by_length = (np.empty_like(since) for _ in range(3))
        _smooth(since, fading, *_sizes(values), self._power, spike, by_height, by_length)
        return spike, by_height, by_length

    def _since(self, motion: Motion, machine: Machine) -> tuple[Floats, Floats]:
        """Return the signed travel since reversal on a smooth path [mm], and the decay variable, shapes (n, 6)."""
        travel, clock = motion.struts(machine).length_mm, self._clock(motion)
        since, late = since_turning_in_time(travel, np.zeros(len(travel)) if clock is None else clock)
        return since, np.abs(since) if clock is None else late

    def _straight(
        self, motion: Motion, machine: Machine, values: Floats, state: Floats
    ) -> tuple[Floats, Floats, Floats, Floats]:
        travel, clock = np.ascontiguousarray(motion.struts(machine).length_mm), self._clock(motion)
        spike, by_height, by_length = (np.empty_like(travel) for _ in range(3))
        behind = state.copy()
        clock = np.zeros(0) if clock is None else np.ascontiguousarray(clock)
        _go_on(travel, clock, *_sizes(values), self._power, TURNED_MM, behind, spike, by_height, by_length)
        return spike, by_height, by_length, behind


class _InTime(ReversalSpike, law="time", law_of=ReversalSpike):
    """Spikes that decay in time: -s a (1 - exp(-d / c|a|)) exp(-t / T), equal at all turning points and feeds."""

    needs = frozenset({Need.POSE, Need.PATH, Need.TIME})
    _power = 1.0

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        meaning = "time in which a spike falls to 37 %, all struts alike"
        return (*super().parameters(machine)[:STRUTS], Parameter("decay_s", "s", 0.2, meaning, DECAY_S))

    def _clock(self, motion: Motion) -> Floats | None:
        return motion.time_s


def _sizes(values: Floats) -> tuple[Floats, float]:
    return MM_PER_UM * values[:STRUTS], float(values[STRUTS])


FULLY = 750.0
"""Decay lengths after which an exponential is zero in double precision."""

WAY, TURN, TURNED, OUTERMOST, LOW, HIGH, BACK, THEN, OUT_THEN = range(9)
"""Memory of a strut: direction (0 if unknown), last turning point, whether it ever reversed, extreme place since then,
range before the direction is known, whether it has left the extreme place, and the times of the turning point and the
extreme place."""

LEFT, LEFT_SINCE = 9, 12
"""Indices of the errors at the turning point and at the extreme place, each followed by its derivatives by height and
decay length."""

_NOTHING = np.zeros((STRUTS, 15))
_NOTHING[:, OUTERMOST] = np.nan
_NOTHING.flags.writeable = False


@inlined
def _spike(
    way: float, fading: float, sign: float, height: float, length: float, power: float
) -> tuple[float, float, float]:
    """Return the spike [mm] after the turning point, and its derivatives by height [1] and by its constant.

    Args:
        fading: decay variable: travel or time since the turning point.
    """
    # A strut that has not reversed has sign 0. A constant of zero gives no spike.
    if length <= 0.0:
        return 0.0, 0.0, 0.0
    ratio = way / (RISE * abs(height)) if height != 0.0 else np.inf
    lacking = np.exp(-ratio)
    faded = (fading / length) ** power
    decay = np.exp(-faded)
    steeper = min(ratio, FULLY) * lacking if lacking > 0.0 else 0.0
    rise = -sign * height * (1.0 - lacking)
    return rise * decay, -sign * (1.0 - lacking - steeper) * decay, rise * power * faded / length * decay


@compiled
def _smooth(
    since: Floats,
    fading: Floats,
    height: Floats,
    length: float,
    power: float,
    spike: Floats,
    by_height: Floats,
    by_length: Floats,
) -> None:
    """Return spikes at signed travel since reversal, shape (n, 6) [mm]."""
    count, columns = since.shape
    for k in range(count):
        for i in range(columns):
            sign = np.sign(since[k, i])
            found = _spike(abs(since[k, i]), fading[k, i], sign, height[i], length, power)
            spike[k, i], by_height[k, i], by_length[k, i] = found


@inlined
def _behind(
    way: float, fading: float, sign: float, height: float, length: float, power: float, left: Floats
) -> tuple[float, float, float]:
    """Return the spike plus the previous spike's remainder, shape (3,), which decays over c|a|."""
    spike, by_height, by_length = _spike(way, fading, sign, height, length, power)
    if left[0] == 0.0 or height == 0.0:
        return spike, by_height, by_length
    ratio = way / (RISE * abs(height))
    kept = np.exp(-ratio)
    by_height += kept * (left[1] + left[0] * min(ratio, FULLY) / height)
    return spike + kept * left[0], by_height, by_length + kept * left[2]


@compiled
def _go_on(  # noqa: C901 - the memory requires one pass
    travel: Floats,
    clock: Floats,
    height: Floats,
    length: float,
    power: float,
    turned: float,
    memory: Floats,
    spike: Floats,
    by_height: Floats,
    by_length: Floats,
) -> None:
    """Continue along a straight path; without a clock, shape (0,), spikes decay with travel."""
    count, columns = travel.shape
    timed = len(clock) > 0
    for i in range(columns):
        m = memory[i]
        for k in range(count):
            x, found = travel[k, i], (0.0, 0.0, 0.0)
            now = clock[k] if timed else 0.0
            if np.isnan(m[OUTERMOST]):
                m[OUTERMOST] = m[LOW] = m[HIGH] = x
            if m[WAY] == 0.0:
                m[LOW], m[HIGH] = min(x, m[LOW]), max(x, m[HIGH])
                if m[HIGH] - x > turned:
                    m[WAY] = -1.0
                elif x - m[LOW] > turned:
                    m[WAY] = 1.0
                m[OUTERMOST], m[OUT_THEN] = x, now
            elif m[WAY] * (x - m[OUTERMOST]) >= 0.0:
                m[OUTERMOST], m[OUT_THEN], m[BACK] = x, now, 0.0
                if m[TURNED] != 0.0:
                    way = m[WAY] * (x - m[TURN])
                    fading = now - m[THEN] if timed else way
                    found = _behind(way, fading, m[WAY], height[i], length, power, m[LEFT : LEFT + 3])
            else:
                if m[BACK] == 0.0:
                    m[BACK] = 1.0
                    if m[TURNED] != 0.0:
                        way = m[WAY] * (m[OUTERMOST] - m[TURN])
                        fading = m[OUT_THEN] - m[THEN] if timed else way
                        found = _behind(way, fading, m[WAY], height[i], length, power, m[LEFT : LEFT + 3])
                    m[LEFT_SINCE], m[LEFT_SINCE + 1], m[LEFT_SINCE + 2] = found
                way = m[WAY] * (m[OUTERMOST] - x)
                fading = now - m[OUT_THEN] if timed else way
                found = _behind(way, fading, -m[WAY], height[i], length, power, m[LEFT_SINCE : LEFT_SINCE + 3])
                if way > turned:
                    m[WAY], m[TURN], m[TURNED], m[BACK] = -m[WAY], m[OUTERMOST], 1.0, 0.0
                    m[THEN] = m[OUT_THEN]
                    m[LEFT : LEFT + 3] = m[LEFT_SINCE : LEFT_SINCE + 3]
                    m[OUTERMOST], m[OUT_THEN] = x, now
            spike[k, i], by_height[k, i], by_length[k, i] = found
