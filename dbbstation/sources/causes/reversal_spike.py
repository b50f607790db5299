"""Struts that stick at reversal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.compiled import compiled, inlined
from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import (
    SMOOTH_MM,
    Effect,
    ErrorSource,
    Motion,
    Need,
    Owner,
    Parameter,
    Texts,
    of_each_strut,
)
from dbbstation.sources.laws.turning import TURNED_MM, since_turning

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

MM_PER_UM = 1e-3

DECAY_MM = tuple(float(f"{decay:.2g}") for decay in np.geomspace(0.0005, 0.8, 12))
"""Decay lengths worth trying: spikes that fade in 0.05 to 0.5 s, on circles of 100 to 150 mm at 500 to 2500 mm/min [mm]."""


RISE = 1.1
"""Multiple of its height over which a spike rises. A strut that sticks would have 1. With 2 a spike that rises at once, 2 to 8 µm high, was found a third too small or, in two of
seven sessions, not at all; with 1.2 and 1.1 it was found in all of them."""


class ReversalSpike(ErrorSource):
    """A reversing strut sticks and is drawn back: -s a (1 - exp(-d / c|a|)) exp(-sqrt(d / l)).

    d is the way since the turning point, s the new sign. The position loop compensates friction with exp(-t / T); with
    d = A t^2 / 2 that is exp(-sqrt(d / l)), l = A T^2 / 2, which needs no clock. At another feed l changes with the
    square of the feed.

    The rise limits the lag to the drive's motion: c = 1 is full sticking. With c = `RISE` the sum of travel and error
    grows and can be compensated. At a = 0 the error is proportional to a.

    A run has no spike before its first turning point. A straight path turns at the outermost row, a smooth one between
    rows (`laws.turning`). A remaining spike fades over c|a| at the next turn. Returns of less than a micrometre do not
    count.
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
        "turned round, s its new direction",
        origin="stick motion of a drive at reversal, as in Kakino, Ihara and Shinohara, Accuracy Inspection of NC "
        "Machine Tools by Double Ball Bar Method, 1993; faded as a position loop of first order does in "
        "time, d = A t^2 / 2 behind the turning point",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        heights = of_each_strut("strut_{}_um", "µm", 2.0, "height of the spike of strut {}; positive: it stays behind")
        meaning = "travel of a strut over which its spike falls to 37 %, all struts alike"
        return (*heights, Parameter("decay_mm", "mm", 0.02, meaning, DECAY_MM))

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        return Effect(strut_mm=self._along(motion, machine, values)[0])

    def begin(self, motion: Motion, machine: Machine, values: Floats) -> Floats:  # noqa: ARG002
        self.require(motion)
        return _NOTHING

    def advance(self, motion: Motion, machine: Machine, values: Floats, state: Floats) -> tuple[Effect, Floats]:
        spike, _, _, behind = _straight(motion.struts(machine).length_mm, values, state)
        return Effect(strut_mm=spike), behind

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        _, by_height, by_length = self._along(motion, machine, values)
        own = MM_PER_UM * by_height[:, :, None] * np.eye(STRUTS)
        return Effect(strut_mm=np.concatenate([own, by_length[:, :, None]], axis=2))

    def _along(self, motion: Motion, machine: Machine, values: Floats) -> tuple[Floats, Floats, Floats]:
        self.require(motion)
        travel = motion.struts(machine).length_mm
        if motion.straight:
            return _straight(travel, values, _NOTHING)[:3]
        spike, by_height, by_length = (np.empty_like(travel) for _ in range(3))
        _smooth(since_turning(travel), *_sizes(values), spike, by_height, by_length)
        return spike, by_height, by_length


def _sizes(values: Floats) -> tuple[Floats, float]:
    return MM_PER_UM * values[:STRUTS], float(values[STRUTS])


def _straight(travel: Floats, values: Floats, state: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    spike, by_height, by_length = (np.empty_like(travel) for _ in range(3))
    behind = state.copy()
    _go_on(np.ascontiguousarray(travel), *_sizes(values), TURNED_MM, behind, spike, by_height, by_length)
    return spike, by_height, by_length, behind


FULLY = 750.0
"""Multiple of its own length after which an exponential is zero in double precision."""

WAY, TURN, TURNED, OUTERMOST, LOW, HIGH, BACK = range(7)
"""What is remembered of a strut: which way it goes (0 before that is known), where it last turned, whether it ever did, its
outermost place since then, its range before the way is known, and whether it has come back from its outermost place."""

LEFT, LEFT_SINCE = 7, 10
"""Error at the turning point, and at the outermost place where it comes back; behind each its derivatives by height and
decay length."""

_NOTHING = np.zeros((STRUTS, 13))
_NOTHING[:, OUTERMOST] = np.nan
_NOTHING.flags.writeable = False


@inlined
def _spike(way: float, sign: float, height: float, length: float) -> tuple[float, float, float]:
    """Return the spike [mm] a way behind the turning point, and derivatives by height and decay length [1].

    A strut that has not turned has sign 0. Decay length zero gives a spike without width.
    """
    if length <= 0.0:
        return 0.0, 0.0, 0.0
    ratio = way / (RISE * abs(height)) if height != 0.0 else np.inf
    lacking = np.exp(-ratio)
    root = np.sqrt(way / length)
    decay = np.exp(-root)
    steeper = min(ratio, FULLY) * lacking if lacking > 0.0 else 0.0
    rise = -sign * height * (1.0 - lacking)
    return rise * decay, -sign * (1.0 - lacking - steeper) * decay, rise * root / (2.0 * length) * decay


@compiled
def _smooth(
    since: Floats,
    height: Floats,
    length: float,
    spike: Floats,
    by_height: Floats,
    by_length: Floats,
) -> None:
    """Return spikes at signed ways since turning, shape (n, 6) [mm]."""
    count, columns = since.shape
    for k in range(count):
        for i in range(columns):
            found = _spike(abs(since[k, i]), np.sign(since[k, i]), height[i], length)
            spike[k, i], by_height[k, i], by_length[k, i] = found


@inlined
def _behind(way: float, sign: float, height: float, length: float, left: Floats) -> tuple[float, float, float]:
    """Return the spike and the previous one's rest, shape (3,), fading over c|a|."""
    spike, by_height, by_length = _spike(way, sign, height, length)
    if left[0] == 0.0 or height == 0.0:
        return spike, by_height, by_length
    ratio = way / (RISE * abs(height))
    kept = np.exp(-ratio)
    by_height += kept * (left[1] + left[0] * min(ratio, FULLY) / height)
    return spike + kept * left[0], by_height, by_length + kept * left[2]


@compiled
def _go_on(  # noqa: C901 - what is remembered decides in one pass
    travel: Floats,
    height: Floats,
    length: float,
    turned: float,
    memory: Floats,
    spike: Floats,
    by_height: Floats,
    by_length: Floats,
) -> None:
    count, columns = travel.shape
    for i in range(columns):
        m = memory[i]
        for k in range(count):
            x, found = travel[k, i], (0.0, 0.0, 0.0)
            if np.isnan(m[OUTERMOST]):
                m[OUTERMOST] = m[LOW] = m[HIGH] = x
            if m[WAY] == 0.0:
                m[LOW], m[HIGH] = min(x, m[LOW]), max(x, m[HIGH])
                if m[HIGH] - x > turned:
                    m[WAY] = -1.0
                elif x - m[LOW] > turned:
                    m[WAY] = 1.0
                m[OUTERMOST] = x
            elif m[WAY] * (x - m[OUTERMOST]) >= 0.0:
                m[OUTERMOST], m[BACK] = x, 0.0
                if m[TURNED] != 0.0:
                    found = _behind(m[WAY] * (x - m[TURN]), m[WAY], height[i], length, m[LEFT : LEFT + 3])
            else:
                if m[BACK] == 0.0:
                    m[BACK] = 1.0
                    if m[TURNED] != 0.0:
                        way = m[WAY] * (m[OUTERMOST] - m[TURN])
                        found = _behind(way, m[WAY], height[i], length, m[LEFT : LEFT + 3])
                    m[LEFT_SINCE], m[LEFT_SINCE + 1], m[LEFT_SINCE + 2] = found
                way = m[WAY] * (m[OUTERMOST] - x)
                found = _behind(way, -m[WAY], height[i], length, m[LEFT_SINCE : LEFT_SINCE + 3])
                if way > turned:
                    m[WAY], m[TURN], m[TURNED], m[BACK] = -m[WAY], m[OUTERMOST], 1.0, 0.0
                    m[LEFT : LEFT + 3] = m[LEFT_SINCE : LEFT_SINCE + 3]
                    m[OUTERMOST] = x
            spike[k, i], by_height[k, i], by_length[k, i] = found
