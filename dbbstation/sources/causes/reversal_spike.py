"""Error source: struts that stick when they turn round."""

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

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine

MM_PER_UM = 1e-3

DECAY_MM = tuple(float(f"{decay:.2g}") for decay in np.geomspace(0.0005, 0.8, 12))
"""Decay lengths worth trying: spikes that fade in 0.05 to 0.5 s, on circles of 100 to 150 mm at 500 to 2500 mm/min [mm]."""

TURNED_MM = 1e-3
"""A strut has turned round once it has come back by this: less is rounding of the program or of recorded angles."""


class ReversalSpike(ErrorSource):
    """A strut sticks when it turns round, and is drawn back: -s a (1 - exp(-d / 2|a|)) exp(-sqrt(d / l)).

    With d the way since the turning point and s the sign of the new movement. The position loop makes up for friction
    exponentially in time; behind a turning point the way grows with the square of time, d = A t^2 / 2, so that
    exp(-t / T) is exp(-sqrt(d / l)) with l = A T^2 / 2. The way needs no clock and holds for programs; at another feed
    l is another, as the square of the feed.

    The rise is there because no strut stays behind by more than its drive has moved. With the 2 the error changes at
    most half as fast as the travel: the rise by up to 1/2, the fading the other way by up to 1 / 4e. Their sum always
    grows, so that the error can be compensated. At a = 0 the error is proportional to a. Where the rise is as long as
    the fading, 2|a| near l, much of a spike is cut off.

    Before the first turning point of a run there is no spike.
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
        equation="actual minus driven length = -s a (1 - exp(-d / 2|a|)) exp(-sqrt(d / l)), d the travel since the strut "
        "turned round, s its new direction",
        origin="stick motion of a drive at reversal, as in Kakino, Ihara and Shinohara, Accuracy Inspection of NC "
        "Machine Tools by Double Ball Bar Method, 1993; faded as a position loop of first order does in "
        "time, d = A t^2 / 2 behind the turning point",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        """Six heights and one decay length."""
        heights = of_each_strut("strut_{}_um", "µm", 2.0, "height of the spike of strut {}; positive: it stays behind")
        meaning = "travel of a strut over which its spike falls to 37 %, all struts alike"
        return (*heights, Parameter("decay_mm", "mm", 0.02, meaning, DECAY_MM))

    def effect(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> Effect:
        """Spikes of each strut.

        Raises:
            ModelError: the motion is no path.
        """
        rise, _, decay, _ = self._spikes(motion, machine, values)
        return Effect(strut_mm=rise * decay)

    def derivative(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> Effect:
        """By the heights, each strut its own, and by the decay length.

        Raises:
            ModelError: the motion is no path.
        """
        rise, by_height, decay, by_length = self._spikes(motion, machine, values)
        own = MM_PER_UM * (by_height * decay)[:, :, None] * np.eye(STRUTS)
        return Effect(strut_mm=np.concatenate([own, (rise * by_length)[:, :, None]], axis=2))

    def _spikes(
        self, motion: Motion, machine: Machine, values: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Both factors of the spike and their derivatives, shapes (n, 6).

        Returns:
            Rise -s a (1 - exp(-d / 2|a|)) [mm], its derivative by a [1], exp(-sqrt(d / l)) [1], its derivative by l [1/mm].
        """
        self.require(motion)
        since = since_turning(motion.struts(machine).length_mm)
        way, sign = np.abs(since), np.sign(since)
        height, length = MM_PER_UM * values[:STRUTS], float(values[STRUTS])
        # What rises over no way has risen; a strut that has not turned has no sign, and no spike.
        ratio = np.divide(way, 2.0 * np.abs(height), out=np.full_like(way, np.inf), where=height != 0.0)
        lacking = np.exp(-ratio)
        by_height = -sign * (1.0 - lacking - np.where(lacking > 0.0, np.minimum(ratio, FULLY) * lacking, 0.0))
        if length <= 0.0:  # the limit, which a fit may try: a spike without width
            decay, by_length = np.zeros_like(way), np.zeros_like(way)
        else:
            root = np.sqrt(way / length)
            decay = np.exp(-root)
            by_length = root / (2.0 * length) * decay
        return -sign * height * (1.0 - lacking), by_height, decay, by_length


FULLY = 750.0
"""Multiple of its own length after which an exponential is zero in double precision."""


def since_turning(travel: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signed way of each column since it last turned round, shape (n, m).

    The turning point lies between rows, in general: it is the vertex of the parabola through the outermost row and its
    two neighbours, over the way of all columns together, so that rows need not be even. Zero before the first one.
    Where the path has a corner or comes straight back, as a single column always does, the outermost row is the turning
    point.
    """
    since = np.zeros_like(travel)
    _since(np.ascontiguousarray(travel), TURNED_MM, since)
    return since


@inlined
def _parabola(travel: NDArray[np.float64], i: int, k: int, side: float) -> tuple[float, float, float, float]:
    """Parabola of a column through row k and its neighbours, over the way of all columns from row to row.

    Returns:
        Slope at row k, half of minus the second derivative, both of `side` times the column, way from the row before
        and way to the next; zeros where the path has a corner at k, or ends there.
    """
    if k < 1 or k + 1 >= travel.shape[0]:
        return 0.0, 0.0, 0.0, 0.0
    before = after = along = 0.0
    for c in range(travel.shape[1]):
        came, goes = travel[k, c] - travel[k - 1, c], travel[k + 1, c] - travel[k, c]
        before, after, along = before + came * came, after + goes * goes, along + came * goes
    if along <= 0.0:  # also where two rows are the same
        return 0.0, 0.0, 0.0, 0.0
    before, after = np.sqrt(before), np.sqrt(after)
    rises = side * (travel[k, i] - travel[k - 1, i]) / before
    falls = side * (travel[k, i] - travel[k + 1, i]) / after
    return (rises * after - falls * before) / (before + after), (rises + falls) / (before + after), before, after


@inlined
def _vertex(travel: NDArray[np.float64], i: int, k: int, side: float) -> tuple[float, bool]:
    """Turning point of a column whose outermost row is k, on the high (1.0) or low (-1.0) side, and whether k is behind.

    Of two rows almost equally far out each has its parabola. Were the turning point taken from one of them alone, it
    would jump as the other becomes the outermost, and a compensation that moves them could go to and fro for ever;
    hence no less than the neighbour's parabola in the middle between both.
    """
    slope, bend, before, after = _parabola(travel, i, k, side)
    if bend <= 0.0:
        return travel[k, i], True
    top = side * travel[k, i] + slope * slope / (4.0 * bend)
    beside, step = (k + 1, after) if slope > 0.0 else (k - 1, before)
    middle = side * (travel[k, i] + travel[beside, i]) / 2.0
    top = max(top, middle + _parabola(travel, i, beside, side)[1] * step * step / 4.0)
    return side * top, slope <= 0.0


@compiled
def _since(travel: NDArray[np.float64], turned: float, since: NDArray[np.float64]) -> None:
    count, columns = travel.shape
    for i in range(columns):
        turn, way, has_turned = 0.0, 0.0, False  # where the column last turned, and which way it goes
        low = high = 0  # outermost rows since then
        for k in range(count):
            x = travel[k, i]
            low = k if x < travel[low, i] else low
            high = k if x > travel[high, i] else high
            new = 0.0
            if way >= 0.0 and travel[high, i] - x > turned:
                new = -1.0
            elif way <= 0.0 and x - travel[low, i] > turned:
                new = 1.0
            if new != 0.0:
                start = high if new < 0.0 else low
                if way != 0.0:  # the first movement is one that was already under way
                    turn, is_behind = _vertex(travel, i, start, -new)
                    has_turned = True
                    # An outermost row that is still before the turning point belongs to the movement before.
                    for j in range(start if is_behind else start + 1, k):
                        since[j, i] = travel[j, i] - turn
                way, low, high = new, k, k
            if has_turned:
                since[k, i] = x - turn
