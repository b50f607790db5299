"""A run's commands and measurements, for calibration and diagnosis."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import FinerMotion, Motion, Setup
from dbbstation.trace.columns import each, temperatures

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.trace.recording import RawCircle

STANDING = 3
"""Samples of a resting machine: the fewest from which a speed is computed."""

LEAD_IN_STEP_DEG = 1.0
"""Spacing of the poses before the turn [deg]; they only build up the memory of sources."""


@dataclass(frozen=True, eq=False)
class Observation:
    """One accepted run.

    Attributes:
        started_s: after the session's start; None if unknown.
        commanded: commanded poses at lead-in and raw samples; None for the plan's circle.
        stood: pose during the set-up of a ball under the spindle, shape (6,); None for the ball's place.
        finer: the run whose means over sectors this one has, and its samples' sectors, shape (m,); None for a run as recorded.
    """

    test: str
    repeat: int
    raw: RawCircle
    setup: Setup
    started_s: float | None = None
    commanded: Floats | None = None
    stood: Floats | None = None
    finer: tuple[Observation, Integers] | None = None

    def with_samples(self, raw: RawCircle) -> Observation:
        """Return the run with other samples of the plan's circle."""
        return replace(self, raw=raw, commanded=None, finer=None)

    @property
    def label(self) -> str:
        """Return the name for texts and tables."""
        return f"{self.test} {self.raw.circle.direction} {self.repeat}"

    @property
    def lead_in_deg(self) -> Floats:
        """Return the lead-in's progress, ending one step before the turn [deg]."""
        return np.arange(-self.raw.circle.overshoot_deg, 0.0, LEAD_IN_STEP_DEG)

    def motion(self) -> Motion:
        """Return the run's motion for error sources: the lead-in arc, then the turn's samples.

        A ball under the spindle is assumed to be set up just before.
        """
        raw, circle = self.raw, self.raw.circle
        name = f"{self.setup.session}: {self.label}"
        setup = replace(self.setup, run=name, start_uncertainty_deg=raw.start_uncertainty_deg)
        lead_in = self.lead_in_deg
        phi = np.concatenate([lead_in, raw.phi_deg])
        before = len(lead_in)
        poses = circle.poses(circle.theta_deg(phi)) if self.commanded is None else self.commanded
        time = None
        if self.started_s is not None:
            time = self.started_s + np.concatenate(
                [raw.t_s[0] + (lead_in - raw.phi_deg[0]) / circle.turning_deg_s, raw.t_s]
            )
        return Motion(
            poses=poses,
            is_path=True,
            kept=slice(before, None),
            time_s=time,
            logged=each(raw.logged, lambda values: _held_back(values, before)),
            setup=setup,
            put_up=None if self.setup.place_known else self._standing(None if time is None else time[0]),
            reading_mm=_held_back(raw.length_mm, before),
            reading_is_measured=True,
            finer=None if self.finer is None else _finer(*self.finer),
        )

    @property
    def standing_pose(self) -> Floats:
        """Return the commanded pose during the ball's set-up, shape (6,) [mm, deg]."""
        return np.array([*self.setup.fixed_ball_mm, *self.raw.circle.tilt_deg]) if self.stood is None else self.stood

    def _standing(self, until_s: float | None) -> Motion:
        raw = self.raw
        pose = self.standing_pose
        return Motion(
            poses=np.tile(pose, (STANDING, 1)),
            is_path=True,
            time_s=None if until_s is None else until_s + np.arange(1.0 - STANDING, 1.0),
            logged=each(temperatures(raw.temperature_degc), lambda values: np.repeat(values[:1], STANDING)),
            setup=self.setup,
            reading_mm=np.repeat(raw.length_mm[:1], STANDING),
        )


@dataclass(frozen=True, eq=False)
class Motions:
    """Motions of runs, made on demand to save memory."""

    observations: Sequence[Observation]

    def __iter__(self) -> Iterator[Motion]:
        return (observation.motion() for observation in self.observations)


def _held_back(values: Floats, count: int) -> Floats:
    return np.concatenate([np.repeat(values[:1], count, axis=0), values])


def _finer(run: Observation, sector: Integers) -> FinerMotion:
    before = len(run.lead_in_deg)
    return FinerMotion(run.motion(), np.concatenate([np.arange(before), before + sector]))
