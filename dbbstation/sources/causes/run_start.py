"""Error of a run's start angle, found from feed-in and feed-out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import Effect, ErrorSource, Motion, Need, Owner, Parameter, Texts

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

    _Travelled = tuple[Floats, CubicSpline, Floats]

USUAL_DEG = 0.05
"""Usual size: a fifth of a sample at ten readings per second."""

FEWEST = 6
"""Fewest places of a path; a machine at rest during a set-up has one."""

SAME_DEG = 1e-9
"""Closer rows count as one place."""


class RunStart(ErrorSource):
    """All angles of one run are too small by d, so the machine was ahead by d along its circle.

    About a centred ball an exact machine shows no effect; an actual machine's figure is rotated. Each run has its own
    d, so it is a random effect with a size given by sampling. `time-skew` is the common part.
    """

    name = "run-start"
    belongs_to = Owner.MOUNTING
    needs = frozenset({Need.POSE, Need.PATH})
    looks_ahead = True  # the turn may have begun earlier or later
    varies_with = "angle"
    candidate = False
    texts = Texts(
        what="The turn was found to begin a little too early or too late along the circle.",
        shows="The figure of one run is turned against that of the others, by a fraction of a sample's way.",
        confirm="Record at a higher rate, or with the control's angles: it becomes smaller or goes away.",
        cure="Record at 25 readings a second or more, or with `theta_deg`; make the feed-in longer.",
        equation="reading(phi) is that of the pose at phi + d: strut error x(phi + d) - x(phi)",
        origin="rounding of an edge to samples that stand apart: uniform within one of them",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return (Parameter("late_deg", "deg", USUAL_DEG, "angle along the travel by which the turn began earlier"),)

    def shared_by(self, motion: Motion) -> str:
        return "" if motion.setup is None else motion.setup.run

    def stated_mm(self, motion: Motion) -> Floats | None:
        """Return the standard uncertainty due to edge sampling [deg]; zero with recorded angles."""
        return np.array([0.0 if motion.setup is None else motion.setup.start_uncertainty_deg])

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        along, spline, there = self._along(motion, machine)
        gone: Floats = spline(along + float(values[0])) - there
        return Effect(strut_mm=gone)

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        along, spline, _ = self._along(motion, machine)
        slope: Floats = spline(along + float(values[0]), 1)
        return Effect(strut_mm=slope[:, :, None])

    def _along(self, motion: Motion, machine: Machine) -> _Travelled:
        """Return travelled angle, shape (n,) [deg], a curve of commanded lengths over it [mm], and its values at the rows, shape (n, 6)."""
        self.require(motion)
        return motion.once("travelled", machine, lambda: _along(motion, motion.struts(machine).length_mm))


def _along(motion: Motion, length: Floats) -> _Travelled:
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 - takes a third of a second; every command knows all sources

    travelled = _travelled_deg(motion)
    rising = np.append(True, np.diff(np.maximum.accumulate(travelled)) > SAME_DEG)
    if np.count_nonzero(rising) < FEWEST:
        travelled = np.zeros(len(motion))
        spline = CubicSpline([0.0, 1.0], np.tile(length[:1], (2, 1)))
    else:
        spline = CubicSpline(travelled[rising], length[rising])
    return travelled, spline, spline(travelled)


def _travelled_deg(motion: Motion) -> Floats:
    if motion.setup is None:
        return np.zeros(len(motion))
    away = motion.poses[:, :2] - motion.setup.fixed_ball_mm[:2]
    if np.hypot(*np.ptp(away, axis=0)) < SAME_DEG:
        return np.zeros(len(motion))
    theta = np.degrees(np.unwrap(np.arctan2(away[:, 1], away[:, 0])))
    return np.asarray(np.abs(theta - theta[0]))
