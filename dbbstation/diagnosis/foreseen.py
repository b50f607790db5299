"""Possible tests, with their information on base and causes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from dbbstation.diagnosis.parts import by_amplitudes, by_terms
from dbbstation.inference.bounds import BOUNDS
from dbbstation.machine.travel import is_within_travel
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Circle, Direction
from dbbstation.sources.contract import Motion, Need, Setup

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.diagnosis.channel import CircleChannel
    from dbbstation.inference.model_comparison import Variant
    from dbbstation.model.machine_model import BarReading
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource

TILTS_DEG = ((0.0, 0.0), (15.0, 0.0), (-15.0, 0.0), (0.0, 15.0), (0.0, -15.0), (23.0, 0.0), (-23.0, 0.0), (0.0, 23.0))
ELEVATIONS_DEG = (0.0, 10.0, -10.0)
WAITS_S = (0.0, 3600.0)
FEEDS = (0.5, 2.0)
"""Tried feeds over the measured feed, for sources that depend on motion; only on upright circles with a level bar."""

SPACING_S = 200.0
"""Time between the starts of successive runs [s]."""


@dataclass(frozen=True)
class Proposal:
    """A proposed circle, with its time after the last run."""

    circle: Circle
    wait_s: float
    observation: Observation

    @property
    def text(self) -> str:
        """Return the proposal in words."""
        x, y, z = (round(value) for value in self.circle.ball_mm)
        a, b, _ = self.circle.tilt_deg
        parts = [f"a circle about the ball at X {x} Y {y} Z {z} mm, tilted A {a:g} B {b:g} degrees"]
        if self.circle.elevation_deg:
            parts.append(f"the bar raised by {self.circle.elevation_deg:g} degrees")
        parts.append("both directions")
        if self.circle.feed_mm_min != self.observation.raw.circle.feed_mm_min:
            parts.append(f"at {self.circle.feed_mm_min:g} mm/min")
        if self.wait_s:
            parts.append(f"{self.wait_s / 3600:.0f} h after the last run")
        return ", ".join(parts)


_Form: TypeAlias = tuple[str, str, tuple[float, ...], float]
"""Name of a source, its law, nonlinear parameters, and waiting time before the run if it depends on time [s]."""


@dataclass(frozen=True, eq=False)
class _Run:
    """One direction of a proposal, with its mounting eliminated.

    Attributes:
        ball: orthonormal effects of ball shifts, shape (n, 3).
        weight: number of samples represented by a row.
        base: rows over base columns, shape (n, t).
        of_sources: rows over amplitudes, by form and waiting time, shape (n, p).
    """

    ball: Floats
    weight: float
    touched: Integers
    base: Floats
    of_sources: dict[_Form, Floats] = field(default_factory=dict)


class ForeseenTests:
    """Possible tests of a channel, each computed once."""

    def __init__(self, channel: CircleChannel) -> None:
        self.channel = channel
        self._ends_s = _ends_s(channel)
        self._samples = float(np.mean([len(o.raw) for o in channel.observations]))
        self._is_reachable = cache(lambda circle: is_within_travel(channel.machine, circle.envelope(step_deg=15.0)))
        self._runs: dict[tuple[Circle, float, str], _Run] = {}

    def that_show(self, needs: Collection[Need]) -> list[Proposal]:
        """Return reachable circles about the plan's balls that can show sources with these inputs."""
        seen: dict[str, Observation] = {}
        for observation in self.channel.observations:
            seen.setdefault(observation.setup.ball, observation)
        waits = WAITS_S if Need.TIME in needs else WAITS_S[:1]
        feeds = FEEDS if {Need.TIME, Need.PATH}.issubset(needs) else ()
        found = []
        for observation in seen.values():
            circle = observation.raw.circle
            x, y, z = circle.ball_mm
            for a, b in TILTS_DEG:
                for elevation in ELEVATIONS_DEG:
                    height = z + circle.bar_mm * float(np.sin(np.radians(elevation)))
                    tried = replace(
                        circle,
                        tilt_deg=(a, b, 0.0),
                        elevation_deg=elevation,
                        centre_mm=(x, y, height),
                        direction=Direction.CCW,
                    )
                    if self._is_reachable(tried):
                        found += [Proposal(tried, wait, observation) for wait in waits]
            upright = replace(circle, tilt_deg=(0.0, 0.0, 0.0), elevation_deg=0.0, centre_mm=(x, y, z))
            for share in feeds:
                tried = replace(upright, feed_mm_min=share * circle.feed_mm_min, direction=Direction.CCW)
                if self._is_reachable(tried):
                    found.append(Proposal(tried, waits[0], observation))
        return found

    def rows(
        self,
        proposal: Proposal,
        direction: Direction,
        asked: Sequence[tuple[ErrorSource, Variant]],
    ) -> tuple[Integers, Floats]:
        """Return the columns of base and sources that a run shows, shape (q,), and its compressed rows over them, (r, q).

        Its new mounting is eliminated.
        """
        run = self._run(proposal, direction, asked)
        place = len(self.channel.base.prior)
        touched, parts = [run.touched], [run.base]
        for source, variant in asked:
            own = run.of_sources[_form(proposal, source, variant)]
            seen = np.flatnonzero(np.any(own != 0.0, axis=0))
            touched.append(place + seen)
            parts.append(own[:, seen])
            # Values of other sessions and mountings do not affect this run.
            place += len(variant.columns)
        return np.concatenate(touched), np.asarray(np.linalg.qr(np.hstack(parts), mode="r"))

    def _run(self, proposal: Proposal, direction: Direction, asked: Sequence[tuple[ErrorSource, Variant]]) -> _Run:
        wait_s = proposal.wait_s if Need.TIME in self.channel.calibration.layout.needs else 0.0
        key = replace(proposal.circle, direction=direction), wait_s, proposal.observation.setup.ball
        run = self._runs.get(key)
        if run is None or any(_form(proposal, *one) not in run.of_sources for one in asked):
            reading = MachineModel(self.channel.machine).bar(_motion(proposal, direction, self._ends_s))
            run = self._runs[key] = run or self._of_base(reading)
            for source, variant in asked:
                form = _form(proposal, source, variant)
                if form not in run.of_sources:
                    derivative = by_amplitudes(reading, source, self.channel.machine, variant.nonlinear)
                    run.of_sources[form] = _without(run.ball, derivative) * run.weight
        return run

    def _of_base(self, reading: BarReading) -> _Run:
        motion = reading.actual.motion
        ball, _ = np.linalg.qr(reading.sensitivity.direction[motion.kept])
        layout = self.channel.calibration.layout
        rows = by_terms(reading, layout, layout.nominal)
        touched = np.flatnonzero(np.any(rows != 0.0, axis=0))
        weight = float(np.sqrt(self._samples / len(rows)))
        return _Run(ball, weight, touched, _without(ball, rows[:, touched]) * weight)


def _form(proposal: Proposal, source: ErrorSource, variant: Variant) -> _Form:
    wait_s = proposal.wait_s if Need.TIME in source.needs else 0.0
    return source.name, source.law, variant.nonlinear, wait_s


def _without(ball: Floats, rows: Floats) -> Floats:
    return rows - ball @ (ball.T @ rows)


def _ends_s(channel: CircleChannel) -> float:
    clocks = [o.started_s + float(o.raw.t_s[-1]) for o in channel.observations if o.started_s is not None]
    return max(clocks, default=0.0)


def _motion(proposal: Proposal, direction: Direction, ends_s: float) -> Motion:
    first_s = ends_s + proposal.wait_s + SPACING_S
    before: Setup = proposal.observation.setup
    moving_s = (*before.moving_s, (first_s, first_s + SPACING_S * len(Direction)))
    phi = np.linspace(-45.0, 360.0, BOUNDS.proposed_samples + BOUNDS.proposed_samples // 8, endpoint=False)
    circle = replace(proposal.circle, direction=direction)
    begun = first_s + SPACING_S * tuple(Direction).index(direction)
    return Motion(
        poses=circle.poses(circle.theta_deg(phi)),
        is_path=True,
        kept=slice(BOUNDS.proposed_samples // 8, None),
        time_s=begun + phi / circle.turning_deg_s,
        setup=replace(before, mounting="proposed", moving_s=moving_s),
    )
