"""Which tests to measure next: the fewest that change a verdict that is still open, or halve an uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit.calibrate import SMALLEST_NOISE_MM
from dbbstation.computing.threads import with_one_thread
from dbbstation.diagnosis.findings import NextTest, Verdict
from dbbstation.diagnosis.verdicts import TESTABLE_SHARE
from dbbstation.errors import MachineError
from dbbstation.inference.square_root import solve
from dbbstation.inference.verdict import OUT
from dbbstation.machine.travel import check_travel
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.circle import Circle, Direction
from dbbstation.sources.contract import Motion, Need, Setup

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.channel import CircleChannel
    from dbbstation.diagnosis.explained import Explained
    from dbbstation.diagnosis.findings import SourceFinding
    from dbbstation.diagnosis.workspace import WorkspaceError
    from dbbstation.inference.model_comparison import Variant
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource

PROPOSED = frozenset({Need.POSE, Need.PATH, Need.TIME})
"""What is known of a test before it is measured."""

SAMPLES = 180
TILTS_DEG = ((0.0, 0.0), (15.0, 0.0), (-15.0, 0.0), (0.0, 15.0), (0.0, -15.0), (23.0, 0.0), (-23.0, 0.0), (0.0, 23.0))
ELEVATIONS_DEG = (0.0, 10.0, -10.0)
WAITS_S = (0.0, 3600.0)
FEEDS = (0.5, 2.0)
"""Of what was measured, for sources that act while the machine moves; tried on upright circles with a level bar."""

MOST_PROPOSED = 3
CLOSER_LOOK = 12
"""Proposals that are looked at in both directions each time that one is chosen."""

HALVED = 0.5
"""Share of an uncertainty that tests must come down to where they change no verdict. Repeating every test once gives 0.7."""

SPACING_S = 200.0
"""From the start of a run to that of the next one [s]."""


@dataclass(frozen=True)
class Proposal:
    """A circle that could be measured, so long after the session's last run."""

    circle: Circle
    wait_s: float
    observation: Observation

    @property
    def text(self) -> str:
        """What to do, in words."""
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


@with_one_thread
def next_tests(
    explained: Explained, findings: Sequence[SourceFinding], elsewhere: WorkspaceError | None
) -> tuple[NextTest, ...]:
    """Return the tests that tell most about the first cause that is still open, told apart from its likenesses.

    A cause that was identified is open too, where the joint model does not know the rest of the workspace better than what
    it corrects there.

    Args:
        explained: what the comparison came to.
        findings: one per named cause, most probable first.
        elsewhere: what the causes change over the workspace; None where none was found.
    """
    channel, settled = explained.channel, explained.settled
    known = elsewhere is None or (elsewhere.uncertainty_um is not None and elsewhere.uncertainty_um < elsewhere.rms_um)
    causes = {cause.name: cause for cause in settled.causes if cause.named}
    found = {m.cause.name: channel.whole(m.cause.name, m.variant) for m in settled.members}
    for finding in findings:
        one_number = finding.name in found and len(found[finding.name].columns) == 1
        if finding.verdict is Verdict.RULED_OUT or (finding.verdict is Verdict.IDENTIFIED and (known or one_number)):
            continue
        asked = [finding.name, *(name for name in (*finding.ambiguous_with, *found) if name in causes)]
        others = [causes[name] for name in dict.fromkeys(asked) if name not in found]
        scan = settled.comparison.scan(settled.best.members, others)
        forms = found | {m.cause.name: channel.whole(m.cause.name, m.variant) for m in scan.best}
        # Nobody knows what a thermometer would show in a test to come: what follows one is taken as known.
        beside = [(channel.source_of(name, forms[name]), forms[name]) for name in dict.fromkeys(asked)]
        foreseen = [(source, variant) for source, variant in beside if Need.TEMPERATURE not in source.needs]
        if not foreseen or foreseen[0][0].name != finding.name:
            continue
        proposed = propose(channel, foreseen, settled.noise_mm)
        if proposed:
            return proposed
    return ()


def propose(
    channel: CircleChannel, asked: Sequence[tuple[ErrorSource, Variant]], noise_mm: float, most: int = MOST_PROPOSED
) -> tuple[NextTest, ...]:
    """Return the fewest tests that together change what can be said of a source, or halve its uncertainty.

    Tests are added one by one, each the one that lowers the root mean square uncertainty of the amplitudes most beside
    those before it. A verdict changes where the source becomes testable beside all that it must be told apart from: half
    of the combinations of its amplitudes, at their plausible sizes, stand out by five standard deviations. An uncertainty
    is that of one combination; a proposal states that of the combination that gains most.

    Empty where so many tests would do neither, where no circle is within reach, or where only the measurement itself
    shows what a source needs.

    Args:
        channel: what was measured.
        asked: the source to reveal, with its columns; then those that it must be told apart from.
        noise_mm: of one sample [mm].
        most: tests at the most.
    """
    if not all(source.needs <= PROPOSED for source, _ in asked):
        return ()
    source, variant = asked[0]
    first = len(channel.base.prior)
    variants = [variant for _, variant in asked]
    known = channel.known_with(variants)
    blocks = channel.blocks(channel.columns_of(variants), np.zeros(channel.runs[-1].stop))
    noise_mm = max(noise_mm, SMALLEST_NOISE_MM)
    covariance = solve(blocks, known, noise_mm, channel.held).covariance
    ends_s = _ends_s(channel)
    own = slice(first, first + len(variant.columns))

    def seen(proposal: Proposal, runs: slice) -> NDArray[np.float64]:
        motions = _motions(proposal, ends_s)[runs]
        return np.vstack([_rows(channel, asked, motion, len(known.prior)) for motion in motions])

    def left(rows: NDArray[np.float64]) -> float:
        return _size(_told(covariance, rows, noise_mm, own), variant)

    proposals = _proposals(channel, frozenset[Need]().union(*(s.needs for s, _ in asked)))
    # One direction tells well enough which tests are worth a closer look beside those already chosen.
    one_way = {k: seen(proposal, slice(1)) for k, proposal in enumerate(proposals)}
    both_ways: dict[int, NDArray[np.float64]] = {}
    chosen: list[Proposal] = []
    sigmas = [_sigmas(covariance[own, own], variant)]
    for _ in range(min(most, len(one_way))):
        closer = sorted(one_way, key=lambda k: left(one_way[k]))[:CLOSER_LOOK]
        for k in closer:
            both_ways.setdefault(k, seen(proposals[k], slice(None)))
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


def _told(
    covariance: NDArray[np.float64], rows: NDArray[np.float64], noise_mm: float, own: slice
) -> NDArray[np.float64]:
    """Covariance of some columns once further rows have been measured."""
    gain = rows @ covariance[:, own]
    answer = rows @ covariance @ rows.T + noise_mm**2 * np.eye(len(rows))
    return np.asarray(covariance[own, own] - gain.T @ np.linalg.solve(answer, gain), dtype=np.float64)


def _size(covariance: NDArray[np.float64], variant: Variant) -> float:
    """Root mean square uncertainty of amplitudes in units of their plausible sizes."""
    return float(np.sqrt(np.mean(np.maximum(np.diag(covariance), 0.0) / variant.plausible**2)))


def _sigmas(covariance: NDArray[np.float64], variant: Variant) -> NDArray[np.float64]:
    """Standard deviations of uncorrelated combinations of amplitudes in units of their plausible sizes, least first, (p,)."""
    variances = np.linalg.eigvalsh(covariance / np.outer(variant.plausible, variant.plausible))
    return np.sqrt(np.maximum(variances, np.finfo(np.float64).tiny))


def _worth_it(now: NDArray[np.float64], then: NDArray[np.float64]) -> bool:
    """Whether a source becomes testable, or a combination of its amplitudes half as uncertain."""
    testable = [bool(np.mean(sigmas <= 1.0 / OUT) >= TESTABLE_SHARE) for sigmas in (now, then)]
    return testable == [False, True] or bool(np.any(then <= HALVED * now))


def _in_words(
    channel: CircleChannel, source: ErrorSource, variant: Variant, proposal: Proposal, before: float, after: float
) -> NextTest:
    parameter = next(p for p in source.parameters(channel.machine) if not p.grid)
    unit = float(variant.plausible[0])
    x, y, z = proposal.circle.ball_mm
    a, b, _ = proposal.circle.tilt_deg
    circle = {"x_mm": x, "y_mm": y, "z_mm": z, "a_deg": a, "b_deg": b, "wait_s": proposal.wait_s}
    circle["elevation_deg"] = proposal.circle.elevation_deg
    circle["feed_mm_min"] = proposal.circle.feed_mm_min
    return NextTest(proposal.text, circle, source.name, before * unit, after * unit, parameter.unit)


def _proposals(channel: CircleChannel, needs: frozenset[Need]) -> list[Proposal]:
    """Circles about the balls of the plan that the machine can run: at other tilts and elevations, feeds and times."""
    seen: dict[str, Observation] = {}
    for observation in channel.observations:
        seen.setdefault(observation.setup.ball, observation)
    waits = WAITS_S if Need.TIME in needs else WAITS_S[:1]
    feeds = FEEDS if {Need.TIME, Need.PATH} <= needs else ()
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
                if _reachable(channel.machine, tried):
                    found += [Proposal(tried, wait, observation) for wait in waits]
        upright = replace(circle, tilt_deg=(0.0, 0.0, 0.0), elevation_deg=0.0, centre_mm=(x, y, z))
        for share in feeds:
            tried = replace(upright, feed_mm_min=share * circle.feed_mm_min, direction=Direction.CCW)
            if _reachable(channel.machine, tried):
                found.append(Proposal(tried, waits[0], observation))
    return found


def _reachable(machine: Machine, circle: Circle) -> bool:
    try:
        check_travel(machine, circle.envelope(step_deg=15.0), where="proposal")
    except MachineError:
        return False
    return True


def _ends_s(channel: CircleChannel) -> float:
    """Return the end of the last run, on the clock of its session [s]; zero where times are unknown."""
    clocks = [o.started_s + float(o.raw.t_s[-1]) for o in channel.observations if o.started_s is not None]
    return max(clocks, default=0.0)


def _motions(proposal: Proposal, ends_s: float) -> list[Motion]:
    """Both directions, mounted anew on the same ball, so long after the end of the last run [s]."""
    first_s = ends_s + proposal.wait_s + SPACING_S
    before: Setup = proposal.observation.setup
    moving_s = (*before.moving_s, (first_s, first_s + SPACING_S * len(Direction)))
    setup = replace(before, mounting="proposed", moving_s=moving_s)
    phi = np.linspace(-45.0, 360.0, SAMPLES + SAMPLES // 8, endpoint=False)
    motions = []
    for k, direction in enumerate(Direction):
        circle = replace(proposal.circle, direction=direction)
        begun = first_s + SPACING_S * k
        motions.append(
            Motion(
                poses=circle.poses(circle.theta_deg(phi)),
                is_path=True,
                kept=slice(SAMPLES // 8, None),
                time_s=begun + phi / circle.turning_deg_s,
                setup=setup,
            )
        )
    return motions


def _rows(
    channel: CircleChannel, asked: Sequence[tuple[ErrorSource, Variant]], motion: Motion, columns: int
) -> NDArray[np.float64]:
    """What a proposed run would say of all columns, compressed to few rows, shape (r, columns).

    Its mounting is new and tells nothing else, so what a shift of the ball could do is taken out of the rows.
    """
    reading = MachineModel(channel.machine).bar(motion)
    rows = np.zeros((len(reading.length_mm), columns))
    place = len(channel.base.prior)
    for source, variant in asked:
        parameters = source.parameters(channel.machine)
        amplitudes = [k for k, p in enumerate(parameters) if not p.grid]
        values = np.zeros(len(parameters))
        values[[k for k, p in enumerate(parameters) if p.grid]] = variant.nonlinear
        derivative = reading.by_source(source, channel.machine, values)
        # A source of the measurement has further sets, of other sessions and mountings, which this run does not touch.
        rows[:, place : place + len(amplitudes)] = derivative[:, amplitudes]
        place += len(variant.columns)
    for term in channel.calibration.layout.terms:
        if term.acts_on(motion):
            zero = channel.calibration.layout.nominal[term.columns]
            rows[:, term.columns] = reading.by_source(term.source, channel.machine, zero)
    ball, _ = np.linalg.qr(reading.sensitivity.direction[motion.kept])
    rows -= ball @ (ball.T @ rows)
    # Few samples stand for the many that a run has.
    rows *= np.sqrt(np.mean([len(o.raw) for o in channel.observations]) / len(rows))
    touched = np.flatnonzero(np.any(rows != 0.0, axis=0))
    triangle = np.linalg.qr(rows[:, touched], mode="r")
    compressed = np.zeros((len(triangle), columns))
    compressed[:, touched] = triangle
    return compressed
