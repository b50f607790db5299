"""Struts along a motion: speeds and turning points; readings without noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.compiled import compiled, inlined
from dbbstation.laws.memory import SHORTEST_S

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import Motion


def driven_in_time(motion: Motion, machine: Machine) -> tuple[Floats, Floats, Integers]:
    """Return commanded strut lengths at strictly ascending times.

    Returns:
        Times, shape (m,) [s], lengths at these times, shape (m, 6) [mm], and each row's index among them, shape (n,).
        Of several rows at one time the last one counts.
    """
    time_s = np.asarray(motion.time_s)
    length = motion.struts(machine).length_mm
    later = np.diff(time_s) > SHORTEST_S
    last = np.append(later, True)
    return time_s[last], length[last], np.concatenate([[0], np.cumsum(later)])


def speed_mm_s(time_s: Floats, length_mm: Floats) -> Floats:
    """Return speeds at ascending times, exact to second order, shape (m, 6) [mm/s]; zero for one row."""
    rows = len(time_s)
    if rows == 1:
        return np.zeros_like(length_mm)
    # At the ends, use a parabola through three rows.
    speed: Floats = np.gradient(length_mm, time_s, axis=0, edge_order=1 if rows == 2 else 2)  # noqa: PLR2004
    return speed


TURNED_MM = 1e-3
"""A strut has reversed once it has come back this far; less is rounding of programs or recorded angles [mm]."""


def since_turning(travel: Floats) -> Floats:
    """Return each column's signed travel since its last reversal, shape (n, m); zero before the first."""
    # The turning point is the vertex of the parabola through the extreme row and its neighbours, over the travel of all
    # columns. At corners and straight returns it is the extreme row.
    return since_turning_in_time(travel, np.zeros(len(travel)))[0]


def since_turning_in_time(travel: Floats, time: Floats) -> tuple[Floats, Floats]:
    """Return this travel and the time since the last reversal, at times of shape (n,); both zero before the first."""
    since, late = np.zeros_like(travel), np.zeros_like(travel)
    _since(np.ascontiguousarray(travel), np.ascontiguousarray(time), TURNED_MM, since, late)
    return since, late


@inlined
def _parabola(travel: Floats, i: int, k: int, side: float) -> tuple[float, float, float, float]:
    """Return the parabola through row k and its neighbours, over the travel of all columns.

    Returns:
        Slope at row k and minus half the second derivative, both of `side` times the column, then travel from the
        previous row and to the next row. All are zero if the path has a corner or an end at k.
    """
    if k < 1 or k + 1 >= travel.shape[0]:
        return 0.0, 0.0, 0.0, 0.0
    before = after = along = 0.0
    for c in range(travel.shape[1]):
        came, goes = travel[k, c] - travel[k - 1, c], travel[k + 1, c] - travel[k, c]
        before, after, along = before + came * came, after + goes * goes, along + came * goes
    if along <= 0.0:  # also for two equal rows
        return 0.0, 0.0, 0.0, 0.0
    before, after = np.sqrt(before), np.sqrt(after)
    rises = side * (travel[k, i] - travel[k - 1, i]) / before
    falls = side * (travel[k, i] - travel[k + 1, i]) / after
    return (rises * after - falls * before) / (before + after), (rises + falls) / (before + after), before, after


@inlined
def _vertex(travel: Floats, i: int, k: int, side: float) -> tuple[float, float]:
    """Return the turning point on the high (1.0) or low (-1.0) side, and its distance after row k, in rows."""
    # The neighbouring parabola midway is a lower limit; otherwise the point could jump between nearly equal rows and
    # make a compensation oscillate.
    slope, bend, before, after = _parabola(travel, i, k, side)
    if bend <= 0.0:
        return travel[k, i], 0.0
    top = side * travel[k, i] + slope * slope / (4.0 * bend)
    beside, step = (k + 1, after) if slope > 0.0 else (k - 1, before)
    middle = side * (travel[k, i] + travel[beside, i]) / 2.0
    top = max(top, middle + _parabola(travel, i, beside, side)[1] * step * step / 4.0)
    # Rounding cannot move the vertex out of the interval between neighbouring rows.
    return side * top, min(max(slope / (2.0 * bend * (after if slope > 0.0 else before)), -1.0), 1.0)


@compiled
def _since(
    travel: Floats,
    time: Floats,
    turned: float,
    since: Floats,
    late: Floats,
) -> None:
    count, columns = travel.shape
    for i in range(columns):
        turn, way, has_turned = 0.0, 0.0, False  # last turning point, and present direction
        then = 0.0
        low = high = 0  # extreme rows since then
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
                if way != 0.0:  # the first movement was already in progress
                    turn, ahead = _vertex(travel, i, start, -new)
                    has_turned = True
                    beside = start + 1 if ahead > 0.0 else max(start - 1, 0)
                    then = time[start] + abs(ahead) * (time[beside] - time[start])
                    # An extreme row still before the turning point belongs to the previous movement.
                    for j in range(start + 1 if ahead > 0.0 else start, k):
                        since[j, i], late[j, i] = travel[j, i] - turn, time[j] - then
                way, low, high = new, k, k
            if has_turned:
                since[k, i], late[k, i] = x - turn, time[k] - then


WINDOWS = 40
"""Pieces of a run on which readings are fitted by a cubic: nine degrees of a circle."""

CUBIC = 3


def reading_without_noise_mm(motion: Motion) -> Floats:
    """Return the reading without most of its noise, shape (n,) [mm].

    An error evaluated at noisy readings would itself look like noise and be misidentified.
    """
    return motion.once("reading without noise", None, lambda: _smoothed(motion))


def _smoothed(motion: Motion) -> Floats:
    reading = np.array(motion.reading_mm, dtype=np.float64)
    own = reading[motion.kept]
    window = 2 * (len(own) // (2 * WINDOWS)) + 1
    if motion.reading_is_measured and window > CUBIC:
        from scipy.linalg import lstsq  # noqa: PLC0415
        from scipy.ndimage import convolve1d  # noqa: PLC0415 - few commands filter

        # The filter of Savitzky and Golay [Anal. Chem. 36 (1964) 1627] as in SciPy's signals, which take half a second to import.
        half, places = window // 2, np.arange(window)
        weights = lstsq((half - places) ** np.arange(CUBIC + 1)[:, None], np.eye(CUBIC + 1)[0])[0]
        smooth = convolve1d(own, weights, mode="constant")
        smooth[:half] = np.polyval(np.polyfit(places, own[:window], CUBIC), places[:half])
        smooth[-half:] = np.polyval(np.polyfit(places, own[-window:], CUBIC), places[-half:])
        reading[motion.kept] = smooth
    return reading
