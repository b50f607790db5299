"""What was commanded and what was measured, side by side: one run as calibration and diagnosis take it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import Motion, Setup
from dbbstation.trace.columns import each, temperatures

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from dbbstation.trace.circle import RawCircle

STANDING = 3
"""Samples of a machine that stands still: as many as a speed is taken from."""

LEAD_IN_STEP_DEG = 1.0
"""Spacing of the poses before the turn, where history is made but nothing is compared [deg]."""


@dataclass(frozen=True, eq=False)
class Observation:
    """One accepted run.

    Attributes:
        test: name of the test in its plan.
        repeat: counts the runs of one test and direction in a session.
        raw: the full turn as measured.
        setup: ball, mounting, bar and how well they are known.
        started_s: start of the run after the start of its session [s]; None where the session does not say.
        commanded: poses that were commanded where they were not the plan's circle, at the raw circle's samples
            after those of the lead-in; None for the plan's circle.
    """

    test: str
    repeat: int
    raw: RawCircle
    setup: Setup
    started_s: float | None = None
    commanded: NDArray[np.float64] | None = None

    @property
    def label(self) -> str:
        """Name of the run in texts and tables."""
        return f"{self.test} {self.raw.circle.direction} {self.repeat}"

    @property
    def lead_in_deg(self) -> NDArray[np.float64]:
        """Progress of the lead-in poses, ending one step before the turn [deg]."""
        return np.arange(-self.raw.circle.overshoot_deg, 0.0, LEAD_IN_STEP_DEG)

    def motion(self) -> Motion:
        """The run as error sources see it: the overshoot arc that leads to the turn, then the turn's samples.

        A ball that was put up under the spindle is taken to have been put up just before the run.
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
        )

    def _standing(self, until_s: float | None) -> Motion:
        """The machine standing still where the ball is put up, three samples a second apart."""
        raw = self.raw
        pose = np.array([*self.setup.fixed_ball_mm, *raw.circle.tilt_deg])
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
    """Motions of runs, each made when it is asked for: its poses are six numbers a sample."""

    observations: Sequence[Observation]

    def __iter__(self) -> Iterator[Motion]:
        return (observation.motion() for observation in self.observations)


def _held_back(values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Values with the first one repeated before them: nobody logged the lead-in."""
    return np.concatenate([np.repeat(values[:1], count, axis=0), values])
