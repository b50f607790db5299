"""Compute low-passed speed and acceleration from position.

Inverse dynamic identification by least squares: zero-phase low-pass, central differences, and a common second low-pass
with decimation for force and columns. [Gautier, Dynamic identification of robots with power model, ICRA 1997; Janot,
Vandanjon and Gautier, A generic instrumental variable approach for industrial robot identification, IEEE TCST 22
(2014), sec. II-C] The position's filter is also applied to force, so filter effects at edges cancel. Friction reverses
suddenly, so speed is computed at full rate.

Friction at standstill is a reaction force without a law, and a stuck force is unknown: such samples have zero weight. If
F is a sum of columns wherever the weight w is nonzero, the equation also holds for low-passed weighted columns,

h * (w F) = sum of theta_k h * (w phi_k),

for any force at w = 0. Divided by h * w, each term is a local mean over moving samples. [Normalized convolution:
Knutsson and Westin, CVPR 1993, 515, eq. 4]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import distance_transform_edt, label, maximum_filter1d
from scipy.signal import butter, savgol_filter, sosfiltfilt, welch

from dbbstation.diagnosis.drive.sampling import (
    RETREAT_SIGMA,
    evenly_sampled,
    resolution_of,
    stuck_samples,
    turning_points,
    ways,
)
from dbbstation.errors import CalibrationError
from dbbstation.inference.square_root import runs_of
from dbbstation.inference.triangle import rms

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.trace.drive import DriveRecording


ORDER = 4
"""Order of the Butterworth filters; doubled by both passes."""

POSITION_BAND = 2.0
"""Cut-off of the position's filter over the comparison's cut-off, so it is flat in the compared band."""

EDGE_PERIODS = 3.0
"""Duration of the filters' ringing, in cut-off periods."""


def low_passed(columns: Floats, rate_hz: float, cutoff_hz: float) -> Floats:
    """Low-pass columns, shape (n,) or (n, p), without phase shift; beyond the ends they are constant."""
    sos = _sections(rate_hz, cutoff_hz)
    beyond = min(_reach(rate_hz, cutoff_hz), len(columns) - 1)
    return sosfiltfilt(sos, columns, axis=0, padtype="constant", padlen=beyond)


@lru_cache(maxsize=64)
def _sections(rate_hz: float, cutoff_hz: float) -> Floats:
    """Second-order sections of both filters; the design takes longer than the filtering of a column."""
    bands = (cutoff_hz, POSITION_BAND * cutoff_hz)
    return np.vstack([butter(ORDER, band, fs=rate_hz, output="sos") for band in bands])


def impulse_response(rate_hz: float, cutoff_hz: float) -> Floats:
    """Return `low_passed` of an impulse, shape (2 k + 1,)."""
    reach = _reach(rate_hz, cutoff_hz)
    at = np.arange(-2 * reach, 2 * reach + 1)
    return low_passed((at == 0).astype(np.float64), rate_hz, cutoff_hz)[reach:-reach]


def _reach(rate_hz: float, cutoff_hz: float) -> int:
    return int(np.ceil(EDGE_PERIODS * rate_hz / cutoff_hz))


def speed_noise_m_s(noise_m: float, rate_hz: float, half: int) -> float:
    """Return noise of a slope over 2 `half` + 1 samples [m/s]."""
    return float(noise_m * rate_hz * np.sqrt(3.0 / (half * (half + 1) * (2 * half + 1))))


def half_window(noise_m: float, rate_hz: float, allowed_m_s: float, most: int) -> int:
    """Return the half-width of the shortest window whose slope noise is permitted; at most `most`."""
    fine = (half for half in range(1, most) if speed_noise_m_s(noise_m, rate_hz, half) <= allowed_m_s)
    return next(fine, most)


def within(marked: Flags, by: int) -> Flags:
    """Mark samples within `by` samples of marked ones, shape (n,)."""
    return maximum_filter1d(marked, 2 * by + 1, mode="constant")


def weights(unknown: Flags, rise: int) -> Floats:
    """Return weights, shape (n,): zero for unknown forces, with gradual rise to one."""
    if not unknown.any():
        return np.ones(len(unknown))
    away = distance_transform_edt(~unknown)
    return np.sin(0.5 * np.pi * np.minimum(away / (rise + 1), 1.0)) ** 2


def rise_of_weights(noise_m: float, rate_hz: float, cutoff_hz: float, allowed_m_s2: float, most: int) -> int:
    """Return the shortest rise of weights [samples] that limits edge noise in the acceleration."""
    response = impulse_response(rate_hz, cutoff_hz)
    at = np.arange(len(response)) - len(response) // 2
    own, unit = _of_second_difference(response), noise_m * rate_hz**2
    for rise in range(most):
        # The edge is assumed in the middle of the filter's response, the worst case.
        edge = weights(at <= -((rise + 1) // 2), rise)
        if unit**2 * (_of_second_difference(response * edge) - own) <= allowed_m_s2**2:
            return rise
    return most


def edge_noise_m_s2(weight: Floats, kept: Integers, noise_m: float, rate_hz: float, cutoff_hz: float) -> Floats:
    """Return the excess acceleration noise of compared samples.

    Returns:
        shape (m,) [m/s²].
    """
    response = impulse_response(rate_hz, cutoff_hz)
    reach = len(response) // 2
    around = np.pad(weight, reach, mode="edge")
    own = _of_second_difference(response)
    more = np.zeros(len(kept))
    for row, first in enumerate(kept):
        near = around[first : first + len(response)]
        if near.min() < 1.0:
            more[row] = _of_second_difference(response * near / float(response @ near)) - own
    return noise_m * rate_hz**2 * np.sqrt(np.maximum(more, 0.0))


def _of_second_difference(row: Floats) -> float:
    """Return the variance of weighted second differences of unit white noise."""
    return float(np.sum(np.diff(np.pad(row, 2), 2) ** 2))


PER_CUTOFF = 2.5
"""Samples kept per period of the cut-off."""

WIDEST = 1 / 20
"""Highest chosen cut-off over the sampling rate; there the differences lose a hundredth of the acceleration."""

HIGHEST_HZ = 100.0
"""Highest chosen cut-off at any sampling rate: above, a drive is not a rigid mass."""

NOISE_SHARE = 0.03
"""Ratio of acceleration noise to acceleration in the chosen band. Noise makes the mass too small by its square, a
thousandth."""

MOVING_SHARE = 0.005
"""Speed over the greatest below which the drive counts as stationary, with unknown friction. Speed noise is kept below
a third of it, or it is raised to three times the noise."""

SURE_SIGMA = 3.0
"""Standard deviations of noise above zero of a moving speed: one sample in 700 of a stationary drive moves by chance."""

ACCELERATING_SHARE = 0.1
"""Acceleration over the greatest above which the drive counts as accelerating."""

LEAST_SHARE = 0.5
"""Least weighted share about a compared sample; with less the mean covers less than half, and force noise is more than
half as large again."""

SLOW_HZ = 5.0
"""Cut-off that strokes of a second need at least for friction; slow recordings receive at most this."""

MOST = 4000
"""Most compared samples. Longer recordings add information on slow effects only, and searches for pulses and waves need
time with their square. Half a minute keeps the widest band of 1000 samples per second."""

FEWEST = 60
"""Fewest compared samples of an identification."""


@dataclass(frozen=True, eq=False)
class Signals:
    """An evenly sampled recording with derivatives and compared samples.

    Attributes:
        position_m: smoothed by local parabolas.
        acceleration_m_s2: of the low-passed position.
        cutoff_hz: cut-off of the band.
        standing_m_s: limit of standstill.
        way: direction of travel between turning points, +1 or -1, shape (n,).
        weight: zero for unknown forces, shape (n,).
        kept: compared samples, shape (m,).
    """

    t_s: Floats
    measured_m: Floats
    position_m: Floats
    speed_m_s: Floats
    acceleration_m_s2: Floats
    force_n: Floats
    rate_hz: float
    cutoff_hz: float
    acceleration_noise_m_s2: float
    position_noise_m: float
    standing_m_s: float
    way: Floats
    weight: Floats
    kept: Integers
    notes: tuple[str, ...]

    def compared(self, columns: Floats) -> Floats:
        """Return weighted band means of columns, shape (n,) or (n, p)."""
        weight, share = (self.weight, self.share) if columns.ndim == 1 else (self.weight[:, None], self.share[:, None])
        found = low_passed(weight * columns, self.rate_hz, self.cutoff_hz)[self.kept]
        return np.ascontiguousarray(found / share)

    @cached_property
    def share(self) -> Floats:
        """Return the weighted share about each compared sample, shape (m,)."""
        return low_passed(self.weight, self.rate_hz, self.cutoff_hz)[self.kept]

    @cached_property
    def edge_noise_m_s2(self) -> Floats:
        """Return excess acceleration noise of compared samples, shape (m,) [m/s²]."""
        return edge_noise_m_s2(self.weight, self.kept, self.position_noise_m, self.rate_hz, self.cutoff_hz)

    @cached_property
    def direction(self) -> Floats:
        """Return the direction of travel, shape (n,); zero at standstill and if noise contradicts it."""
        return np.where(self.speed_m_s * self.way > self.standing_m_s, self.way, 0.0)

    @cached_property
    def reversals(self) -> Integers:
        """Return samples of direction changes."""
        moving = np.flatnonzero(self.direction != 0.0)
        turned = np.flatnonzero(np.diff(self.direction[moving]) != 0.0)
        return (moving[turned] + moving[turned + 1]) // 2

    @cached_property
    def since_reversal_m(self) -> Floats:
        """Return travel since the last reversal, shape (n,) [m]; infinite before."""
        last = np.searchsorted(self.reversals, np.arange(len(self.t_s)), side="right") - 1
        if not len(self.reversals):
            return np.full(len(self.t_s), np.inf)
        travel = np.abs(self.position_m - self.position_m[self.reversals[np.maximum(last, 0)]])
        return np.where(last >= 0, travel, np.inf)

    @cached_property
    def turns(self) -> Flags:
        """Mark samples within half a cut-off period of starts, stops and reversals, shape (n,)."""
        acceleration = np.abs(self.acceleration_m_s2)
        changing = (self.direction == 0.0) | (acceleration > ACCELERATING_SHARE * acceleration.max())
        stretch, _ = label(changing)
        stands = np.unique(stretch[self.direction == 0.0])
        return within(np.isin(stretch, stands[stands > 0]), int(0.5 * self.rate_hz / self.cutoff_hz))


def signals_of(recording: DriveRecording, cutoff_hz: float | None = None) -> Signals:
    """Prepare a recording.

    Args:
        cutoff_hz: None to choose it from the data.

    Raises:
        CalibrationError: too short, no motion, dead or saturated force, or unsuitable cut-off.
    """
    even, rate, notes = evenly_sampled(recording)
    position = 1e-3 * even.position_mm
    if not np.ptp(position) > 0.0:
        raise CalibrationError(
            "the position does not change", where=recording.name, remedy="record the drive while it travels to and fro"
        )
    frequency, power = _spectrum(position, rate)
    floor = float(np.median(power[frequency > 0.375 * rate]))
    cutoff = _chosen_cutoff(position, rate, floor) if cutoff_hz is None else cutoff_hz
    if not 0.0 < cutoff <= rate / (2.5 * POSITION_BAND):
        raise CalibrationError(
            f"a cut-off of {cutoff:g} Hz does not suit {rate:g} samples per second",
            where=recording.name,
            remedy=f"give one up to {rate / (2.5 * POSITION_BAND):.3g} Hz",
        )
    edge = int(np.ceil(EDGE_PERIODS * rate / cutoff))
    if len(position) - 2 * edge < FEWEST * rate / (PER_CUTOFF * cutoff):
        raise CalibrationError(
            f"{len(position) / rate:.2f} s are too short for a cut-off of {cutoff:.3g} Hz",
            where=recording.name,
            remedy="record for longer, ten strokes to and fro at several speeds, or give a higher --cutoff-hz",
        )
    step = max(int(rate / (PER_CUTOFF * cutoff)), 1)
    smooth = sosfiltfilt(butter(ORDER, POSITION_BAND * cutoff, fs=rate, output="sos"), position)
    slow, acceleration = derivatives(smooth, rate)
    # White noise: power per hertz up to half the sampling rate.
    noise_m, standing_m_s = float(np.sqrt(0.5 * floor * rate)), MOVING_SHARE * float(np.abs(slow).max())
    half = half_window(noise_m, rate, standing_m_s / SURE_SIGMA, max(step // 2, 1))
    standing_m_s = max(standing_m_s, SURE_SIGMA * speed_noise_m_s(noise_m, rate, half))
    place, speed = (savgol_filter(position, 2 * half + 1, 2, deriv=k, delta=1.0 / rate) for k in (0, 1))
    wobble_m = rms(position - smooth)
    # Rounding steps above the travel per sample are not white noise.
    retreat = RETREAT_SIGMA * max(noise_m, wobble_m) + 1.5 * (1e-3 * resolution_of(recording.position_mm))
    way = ways(place, turning_points(place, retreat))
    standing = speed * way <= standing_m_s
    stuck, stuck_notes = stuck_samples(even.force_n, even.t_s, ~standing, recording.name)
    notes += [*stuck_notes, *_rests(standing, even.force_n, rate, step)]
    turned = speed[1:] * speed[:-1] < 0.0  # a quick reversal passes through standstill between two samples
    standing[1:] |= turned
    standing[:-1] |= turned
    # Near standstill, the smoothed speed is not the speed of a moving drive.
    allowed = NOISE_SHARE * rms(acceleration)
    weight = weights(within(standing, half) | stuck, rise_of_weights(noise_m, rate, cutoff, allowed, step))
    kept = np.arange(edge, len(position) - edge, step)
    kept = kept[low_passed(weight, rate, cutoff)[kept] >= LEAST_SHARE]
    if len(kept) < FEWEST:
        raise CalibrationError(
            f"only {len(kept)} samples in the band show a moving drive",
            where=recording.name,
            remedy="record the drive while it travels to and fro, at several speeds",
        )
    return Signals(
        t_s=even.t_s,
        measured_m=position,
        position_m=place,
        speed_m_s=speed,
        acceleration_m_s2=acceleration,
        force_n=even.force_n,
        rate_hz=rate,
        cutoff_hz=cutoff,
        acceleration_noise_m_s2=float(np.sqrt(_acceleration_noise(floor, cutoff))),
        position_noise_m=noise_m,
        standing_m_s=standing_m_s,
        way=way,
        weight=weight,
        kept=kept,
        notes=tuple(notes),
    )


def _rests(standing: Flags, force_n: Floats, rate_hz: float, step: int) -> list[str]:
    long = [rows for rows in runs_of(standing) if rows.stop - rows.start > RESTS * step]
    if not long:
        return []
    seconds = sum(rows.stop - rows.start for rows in long) / rate_hz
    force = float(np.mean(np.concatenate([force_n[rows] for rows in long])))
    text = (
        f"the drive rests in {len(long)} stretches, {seconds:.3g} s in all, with a mean force of {force:.3g} N; friction holds "
        "whatever it can there, so that models of motion are compared on the rest of the recording"
    )
    return [text]


RESTS = 10
"""Fewest compared samples of a rest; a shorter standstill is a reversal."""


def derivatives(position_m: Floats, rate_hz: float) -> tuple[Floats, Floats]:
    """Return speed [m/s] and acceleration [m/s²] by central differences, shape (n,) each; acceleration is zero at ends."""
    acceleration = np.zeros_like(position_m)
    acceleration[1:-1] = (position_m[2:] - 2.0 * position_m[1:-1] + position_m[:-2]) * rate_hz**2
    return np.gradient(position_m, 1.0 / rate_hz), acceleration


def acceleration_over_two(position_m: Floats, rate_hz: float) -> Floats:
    """Return acceleration [m/s²] over two samples each side, shape (n,), zero at ends."""
    found = np.zeros_like(position_m)
    found[2:-2] = (position_m[4:] - 2.0 * position_m[2:-2] + position_m[:-4]) * (0.5 * rate_hz) ** 2
    return found


def _spectrum(position_m: Floats, rate_hz: float) -> tuple[Floats, Floats]:
    frequency, power = welch(position_m, rate_hz, "hann", min(len(position_m), 4096))
    return frequency, power


def _acceleration_noise(floor: float, cutoff_hz: float | Floats) -> float | Floats:
    """Return the mean square acceleration of white noise below a cut-off [m²/s⁴]."""
    return floor * (2.0 * np.pi) ** 4 * cutoff_hz**5 / 5.0


def _chosen_cutoff(position_m: Floats, rate_hz: float, floor: float) -> float:
    """Return the highest cut-off with significant acceleration [Hz], else the cut-off of a hundred samples."""
    frequency, power = _spectrum(position_m, rate_hz)
    widest = min(rate_hz * WIDEST, HIGHEST_HZ)
    tried = np.geomspace(min(2.0, 0.5 * widest), widest, 40)
    signal = np.array(
        [np.trapezoid(power * (2.0 * np.pi * frequency) ** 4 * (frequency <= f), frequency) for f in tried]
    )
    noise = _acceleration_noise(floor, tried)
    good = np.flatnonzero(noise <= NOISE_SHARE**2 * np.maximum(signal - noise, 0.0))
    moving = np.abs(np.gradient(position_m))
    seconds = np.count_nonzero(moving > MOVING_SHARE * moving.max()) / rate_hz
    needed = (2.0 * FEWEST / PER_CUTOFF + 2.0 * EDGE_PERIODS) / max(seconds, 1.0 / rate_hz)
    chosen = float(tried[good[-1]]) if len(good) else min(widest, max(needed, SLOW_HZ))
    # With exact differences, slow recordings would have too few samples, long ones too many.
    most = max(MOST / (PER_CUTOFF * seconds), min(needed, SLOW_HZ)) if seconds > 0.0 else chosen
    return float(min(max(min(chosen, most), min(needed, SLOW_HZ)), rate_hz / (2.5 * POSITION_BAND)))
