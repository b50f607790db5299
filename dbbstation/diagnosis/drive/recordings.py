"""Recordings of one drive, concatenated with a common low-pass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.signals import acceleration_over_two, derivatives, impulse_response, signals_of
from dbbstation.errors import CalibrationError
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.forms import Clock
from dbbstation.inference.levels import OUT
from dbbstation.inference.square_root import slices
from dbbstation.inference.triangle import left_by, rms
from dbbstation.laws.contract import Scale

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.drive.signals import Signals
    from dbbstation.trace.drive import DriveRecording

AGAINST = 0.3
"""Negative correlation with speed that proves a wrong sign: a tenth of the squared force. A delay in a drive with
little friction causes less."""

EACH_WAY = 0.05
"""Least share of samples in each direction for direction-dependent results; with fewer they would describe stops,
overshoots or filter artefacts."""


@dataclass(frozen=True, eq=False)
class Recordings:
    """One or several recordings of one drive."""

    names: tuple[str, ...]
    signals: tuple[Signals, ...]

    def compared(self, columns: Callable[[Signals], Floats]) -> Floats:
        """Return low-passed columns at compared samples of all recordings, (m,) or (m, p)."""
        return np.concatenate([one.compared(columns(one)) for one in self.signals])

    def at(self, values: Callable[[Signals], Floats]) -> Floats:
        """Return unfiltered values at compared samples, shape (m,)."""
        return np.concatenate([values(one)[one.kept] for one in self.signals])

    @cached_property
    def blocks(self) -> tuple[slice, ...]:
        """Return rows of each recording."""
        return tuple(slices(len(one.kept) for one in self.signals))

    @cached_property
    def force_n(self) -> Floats:
        """Return the low-passed force, shape (m,) [N]."""
        return self.compared(lambda s: s.force_n)

    @cached_property
    def motion(self) -> Floats:
        """Return low-passed acceleration [m/s²] and speed [m/s], shape (m, 2), from the unfiltered position."""
        return self.compared(lambda s: np.column_stack(derivatives(s.measured_m, s.rate_hz)[::-1]))

    @cached_property
    def lost_share(self) -> float:
        """Return the acceleration's relative loss by differences over one sample, (w h)²/12; over two it is (2 w h)²/12."""
        over_one = self.motion[:, 0]
        over_two = self.compared(lambda s: acceleration_over_two(s.measured_m, s.rate_hz))
        return max(float(over_one @ (over_one - over_two)) / 3.0 / max(float(over_one @ over_one), 1e-300), 0.0)

    @cached_property
    def edge_noise_n(self) -> Floats:
        """Return the excess force noise at edges of weights, shape (m,) [N]: acceleration noise times estimated mass."""
        direction = self.compared(lambda s: s.direction)
        mass = np.linalg.lstsq(np.column_stack([self.motion, direction]), self.force_n, rcond=None)[0][0]
        return abs(float(mass)) * np.concatenate([one.edge_noise_m_s2 for one in self.signals])

    @cached_property
    def time_s(self) -> Floats:
        """Return concatenated time, shape (m,) [s]."""
        found, end = [], 0.0
        for one in self.signals:
            found.append(one.t_s[one.kept] - one.t_s[0] + end if len(self.signals) > 1 else one.t_s[one.kept])
            end += float(one.t_s[-1] - one.t_s[0]) + 1.0
        return np.concatenate(found)

    @cached_property
    def scale(self) -> Scale:
        """Return sizes over all recordings."""
        return Scale(
            force_n=rms(self.force_n),
            speed_m_s=float(np.abs(self.at(lambda s: s.speed_m_s)).max()),
            low_m=min(float(s.position_m.min()) for s in self.signals),
            high_m=max(float(s.position_m.max()) for s in self.signals),
            mean_m=float(np.mean(self.at(lambda s: s.position_m))),
            duration_s=max(float(s.t_s[-1] - s.t_s[0]) for s in self.signals),
            cutoff_hz=self.signals[0].cutoff_hz,
            sample_s=1.0 / min(s.rate_hz for s in self.signals),
            reverses=any(len(s.reversals) > 0 for s in self.signals),
            both_ways=self.least_way >= EACH_WAY,
        )

    @cached_property
    def least_way(self) -> float:
        """Return the rarer direction's share of samples."""
        way = self.at(lambda s: s.direction)
        return float(min(np.mean(way > 0.0), np.mean(way < 0.0)))

    @cached_property
    def samples_apart_s(self) -> float:
        """Return the spacing of compared samples [s]."""
        one = self.signals[0]
        return float(np.median(np.diff(one.kept))) / one.rate_hz

    @cached_property
    def clock(self) -> Clock:
        """Return the times of compared samples, with the low-pass's step response."""
        one, apart_s = self.signals[0], self.samples_apart_s
        step = np.cumsum(impulse_response(one.rate_hz, one.cutoff_hz))
        since_s = (np.arange(len(step)) - len(step) // 2) / one.rate_hz
        reach = float(np.abs(since_s[[0, -1]]).max()) / apart_s
        return Clock(self.time_s / apart_s, lambda since: np.interp(since * apart_s, since_s, step), reach)

    @property
    def notes(self) -> list[str]:
        """Return notes on preparation."""
        if len(self.signals) == 1:
            return list(self.signals[0].notes)
        return [f"{name}: {note}" for name, one in zip(self.names, self.signals, strict=True) for note in one.notes]


def recordings_of(recordings: Sequence[DriveRecording], cutoff_hz: float | None = None) -> Recordings:
    """Filter all recordings with the lowest of their cut-offs.

    Raises:
        CalibrationError: as `signals_of`, or force contradicts motion.
    """
    signals = tuple(signals_of(recording, cutoff_hz) for recording in recordings)
    lowest = min(one.cutoff_hz for one in signals)
    signals = tuple(
        one if one.cutoff_hz == lowest else signals_of(recording, lowest)
        for one, recording in zip(signals, recordings, strict=True)
    )
    for recording, one in zip(recordings, signals, strict=True):
        _refuse_wrong_sign(Recordings((recording.name,), (one,)))
    return Recordings(tuple(recording.name for recording in recordings), signals)


def _refuse_wrong_sign(one: Recordings) -> None:
    """Refuse a force with wrong sign."""
    # After removal of inertia, load and spring, friction makes force and speed positively correlated.
    force, speed = one.force_n, one.motion[:, 1]
    if not one.scale.reverses:
        return
    conservative = np.column_stack([np.ones(len(force)), one.motion[:, 0], one.at(lambda s: s.position_m)])
    left = left_by(conservative, force)
    powers = [float(np.mean(part)) for part in np.array_split(left * speed, BOUNDS.power_stretches)]
    mean, sigma = float(np.mean(powers)), float(np.std(powers)) / np.sqrt(len(powers))
    agreement = float(left @ speed) / max(float(np.linalg.norm(left) * np.linalg.norm(speed)), 1e-300)
    if mean < -OUT * sigma and agreement < -AGAINST:
        raise CalibrationError(
            f"the force has the wrong sign: it acts against the motion (correlation with the speed {agreement:.2f}), so that "
            f"the drive would gain {-mean:.3g} W from its friction",
            where=one.names[0],
            remedy="force and current must be positive towards greater positions; change the sign of one channel",
        )
