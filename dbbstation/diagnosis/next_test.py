"""Propose the fewest tests that change an open verdict or halve an uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit.calibrate import SMALLEST_NOISE_MM
from dbbstation.computing.threads import with_one_thread
from dbbstation.diagnosis.effects import TILTS_DEG
from dbbstation.diagnosis.findings import NextTest
from dbbstation.diagnosis.parts import amplitudes, by_amplitudes, by_terms
from dbbstation.inference.alternatives import would_show
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.levels import Verdict
from dbbstation.inference.model_comparison import all_columns
from dbbstation.inference.square_root import solve
from dbbstation.machine.travel import is_within_travel
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Circle, Direction
from dbbstation.sources.contract import Motion, Need, Setup

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.diagnosis.channel import CircleChannel
    from dbbstation.diagnosis.effects import WorkspaceError
    from dbbstation.diagnosis.explain import Explained
    from dbbstation.diagnosis.findings import SourceFinding
    from dbbstation.inference.model_comparison import Variant
    from dbbstation.model.machine_model import BarReading
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource


STEEP_DEG = ((23.0, 0.0), (-23.0, 0.0), (0.0, 23.0))
"""Further tilts of proposed tests."""

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


_Run = tuple["Circle", str, float]
"""Circle, ball, and time after the last run."""


class ForeseenTests:
    """Possible tests of a channel; what a run would show is computed once."""

    def __init__(self, channel: CircleChannel) -> None:
        self.channel = channel
        self._ends_s = _ends_s(channel)
        self._samples = float(np.mean([len(o.raw) for o in channel.observations]))
        self._motions: dict[_Run, Motion] = {}
        self._places: dict[tuple[Circle, str], BarReading] = {}
        self._base: dict[_Run, tuple[Integers, Floats]] = {}
        self._columns: dict[tuple[object, ...], Floats] = {}
        self._is_reachable = cache(lambda circle: is_within_travel(channel.machine, circle.envelope(step_deg=15.0)))

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
            for a, b in (*TILTS_DEG, *STEEP_DEG):
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
        self, proposal: Proposal, directions: Sequence[Direction], asked: Sequence[tuple[ErrorSource, Variant]]
    ) -> Floats:
        """Return compressed rows of a proposal's runs over the columns of base, then sources, shape (r, k).

        Its new mountings are eliminated.
        """
        layout, found = self.channel.calibration.layout, []
        for direction in directions:
            run, reading = self._run(proposal, direction)
            if run not in self._base:
                base = by_terms(reading, layout, layout.nominal)
                acting = np.flatnonzero(base.any(axis=0))
                self._base[run] = acting, base[:, acting]
            acting, base = self._base[run]
            parts = [np.zeros((len(base), len(layout.nominal)))]
            parts[0][:, acting] = base
            for source, variant in asked:
                form = (*run, source.name, source.law, variant.nonlinear)
                if form not in self._columns:
                    self._columns[form] = by_amplitudes(reading, source, self.channel.machine, variant.nonlinear)
                own = self._columns[form]
                # Values of other sessions and mountings do not affect this run.
                parts.append(np.pad(own, ((0, 0), (0, len(variant.columns) - own.shape[1]))))
            rows = np.hstack(parts)
            ball, _ = np.linalg.qr(reading.sensitivity.direction[reading.actual.motion.kept])
            # Each row represents several samples.
            rows = (rows - ball @ (ball.T @ rows)) * float(np.sqrt(self._samples / len(rows)))
            seen = np.flatnonzero(rows.any(axis=0))
            found.append(np.zeros((min(len(rows), len(seen)), rows.shape[1])))
            found[-1][:, seen] = np.linalg.qr(rows[:, seen], mode="r")
        return np.vstack(found)

    def _run(self, proposal: Proposal, direction: Direction) -> tuple[_Run, BarReading]:
        """Return a proposal's run, with its reading on a motion of its own: what sources keep of a motion would fill the memory."""
        circle, ball = replace(proposal.circle, direction=direction), proposal.observation.setup.ball
        run = circle, ball, proposal.wait_s
        if run not in self._motions:
            self._motions[run] = _motion(proposal, direction, self._ends_s)
        motion = replace(self._motions[run])
        if (circle, ball) not in self._places:
            there = MachineModel(self.channel.machine).bar(motion)
            self._places[circle, ball] = replace(there, actual=replace(there.actual, motion=self._motions[run]))
        # A machine without causes takes the same path at any time.
        reading = self._places[circle, ball]
        return run, replace(reading, actual=replace(reading.actual, motion=motion))


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


PROPOSED = frozenset({Need.POSE, Need.PATH, Need.TIME})
"""Inputs known before a test is measured."""

HALVED = 0.5
"""If tests cannot change a verdict, they must reduce an uncertainty to this share; repeating every test once gives 0.7."""


@with_one_thread
def next_tests(
    explained: Explained, findings: Sequence[SourceFinding], elsewhere: WorkspaceError | None
) -> tuple[NextTest, ...]:
    """Return the best tests for the first open cause and its rivals.

    An identified cause is open if the workspace remains more uncertain than corrected.
    """
    channel, settled = explained.channel, explained.settled
    could_be = ForeseenTests(channel)
    known = elsewhere is None or (
        elsewhere.uncertainty_rms_um is not None and elsewhere.uncertainty_rms_um < elsewhere.error_rms_um
    )
    causes = {cause.name: cause for cause in settled.causes if cause.named}
    found = {m.name: channel.whole(m.name, m.variant) for m in settled.members}
    for finding in findings:
        one_number = finding.name in found and len(found[finding.name].columns) == 1
        if finding.verdict is Verdict.RULED_OUT or (finding.verdict is Verdict.IDENTIFIED and (known or one_number)):
            continue
        asked = [finding.name, *(name for name in (*finding.ambiguous_with, *found) if name in causes)]
        others = [causes[name] for name in dict.fromkeys(asked) if name not in found]
        scan = settled.comparison.scan(settled.best.members, others)
        forms = found | {m.name: channel.whole(m.name, m.variant) for m in scan.best}
        # Future temperatures are unknown, so effects by thermometers are assumed known.
        beside = [(channel.source_of(name, forms[name]), forms[name]) for name in dict.fromkeys(asked)]
        foreseen = [(source, variant) for source, variant in beside if Need.TEMPERATURE not in source.needs]
        if not foreseen or foreseen[0][0].name != finding.name:
            continue
        proposed = propose(could_be, foreseen, settled.noise_mm)
        if proposed:
            return proposed
    return ()


def propose(
    could_be: ForeseenTests, asked: Sequence[tuple[ErrorSource, Variant]], noise_mm: float
) -> tuple[NextTest, ...]:
    """Return the fewest tests that change a source's verdict or halve its uncertainty.

    Tests are added greedily by rms amplitude uncertainty. A verdict changes if half of the plausible combinations reach
    five standard deviations. The halved uncertainty is of the best combination. The result is empty if the permitted
    number of tests does not suffice, no circle is reachable, or inputs are unpredictable.

    Args:
        asked: the source with its columns, then rivals.
    """
    if not all(source.needs <= PROPOSED for source, _ in asked):
        return ()
    channel = could_be.channel
    source, variant = asked[0]
    first = len(channel.base.prior)
    variants = [variant for _, variant in asked]
    known = channel.known_with(variants)
    blocks = channel.blocks(all_columns(variants), np.zeros(channel.runs[-1].stop))
    noise_mm = max(noise_mm, SMALLEST_NOISE_MM)
    covariance = solve(blocks, known, noise_mm, channel.held).covariance
    own = slice(first, first + len(variant.columns))

    def left(rows: Floats) -> float:
        return _size(_told(covariance, rows, noise_mm, own), variant)

    proposals = could_be.that_show(frozenset[Need]().union(*(s.needs for s, _ in asked)))
    # One direction suffices to select the tests for closer evaluation.
    one_way = {k: could_be.rows(proposal, [*Direction][:1], asked) for k, proposal in enumerate(proposals)}
    both_ways: dict[int, Floats] = {}
    chosen: list[Proposal] = []
    sigmas = [_sigmas(covariance[own, own], variant)]
    for _ in range(min(BOUNDS.proposed, len(one_way))):
        closer = sorted(one_way, key=lambda k: left(one_way[k]))[: BOUNDS.closer_look]
        for k in closer:
            both_ways.setdefault(k, could_be.rows(proposals[k], [*Direction], asked))
        _, k = min((left(both_ways[k]), k) for k in closer)
        del one_way[k]
        covariance = _told(covariance, both_ways[k], noise_mm, slice(None))
        chosen.append(proposals[k])
        sigmas.append(_sigmas(covariance[own, own], variant))
        if _worth_it(sigmas[0], sigmas[-1]):
            most_gained = int(np.argmin(sigmas[-1] / sigmas[0]))
            of = [float(each[most_gained]) for each in sigmas]
            return tuple(
                _in_words(channel, source, variant, proposal, before, after)
                for proposal, before, after in zip(chosen, of[:-1], of[1:], strict=True)
            )
    return ()


def _told(covariance: Floats, rows: Floats, noise_mm: float, own: slice) -> Floats:
    columns = np.flatnonzero(rows.any(axis=0))
    rows = rows[:, columns]
    gain = rows @ covariance[columns, own]
    answer = rows @ covariance[np.ix_(columns, columns)] @ rows.T + noise_mm**2 * np.eye(len(rows))
    return covariance[own, own] - gain.T @ np.linalg.solve(answer, gain)


def _size(covariance: Floats, variant: Variant) -> float:
    return float(np.sqrt(np.mean(np.maximum(np.diag(covariance), 0.0) / variant.plausible**2)))


def _sigmas(covariance: Floats, variant: Variant) -> Floats:
    variances = np.linalg.eigvalsh(covariance / np.outer(variant.plausible, variant.plausible))
    return np.sqrt(np.maximum(variances, np.finfo(np.float64).tiny))


def _worth_it(now: Floats, then: Floats) -> bool:
    testable = [would_show(1.0 / sigmas) for sigmas in (now, then)]
    return testable == [False, True] or bool(np.any(then <= HALVED * now))


def _in_words(
    channel: CircleChannel, source: ErrorSource, variant: Variant, proposal: Proposal, before: float, after: float
) -> NextTest:
    unit = float(variant.plausible[0])
    circle = proposal.circle
    (x, y, z), (a, b, _) = circle.ball_mm, circle.tilt_deg
    return NextTest(
        text=proposal.text,
        x_mm=x,
        y_mm=y,
        z_mm=z,
        a_deg=a,
        b_deg=b,
        elevation_deg=circle.elevation_deg,
        feed_mm_min=circle.feed_mm_min,
        wait_s=proposal.wait_s,
        source=source.name,
        sigma_before=before * unit,
        sigma_after=after * unit,
        unit=amplitudes(source, channel.machine)[0].unit,
    )
