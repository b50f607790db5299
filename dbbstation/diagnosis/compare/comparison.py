"""Compare two sessions, explain their difference, predict held-out tests, and note differing conditions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import expit, logsumexp

from dbbstation.calibration.fit.calibrate import KINEMATIC_SOURCES
from dbbstation.calibration.fit.methods import CENTRED_MM
from dbbstation.computing.grouped import grouped
from dbbstation.computing.threads import with_one_thread
from dbbstation.diagnosis.compare.channel import channel_of
from dbbstation.diagnosis.compare.findings import DirectionHalves, EffectOfCause, LargestEffect, RunDifference
from dbbstation.diagnosis.compare.pairs import Sides, match
from dbbstation.diagnosis.compare.set_up import with_set_up
from dbbstation.errors import TraceError
from dbbstation.inference.alternatives import cancelling
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.folds import (
    errors_without,
    gains_of_tests,
    groups_of_tests,
    refits_without,
    rows_of_groups,
)
from dbbstation.inference.harmonics import bands, basis, coefficients
from dbbstation.inference.left_over import left_over
from dbbstation.inference.levels import OUT, SURE
from dbbstation.inference.levels_of import levels_by_tests
from dbbstation.inference.model_comparison import all_columns
from dbbstation.inference.read_off import Trial, read_off
from dbbstation.inference.settle import settle
from dbbstation.inference.square_root import compress
from dbbstation.inference.triangle import ROUNDING, rms, root
from dbbstation.sources.registry import sources_named
from dbbstation.trace.analysis import figures

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.diagnosis.compare.pairs import Matching, Pair
    from dbbstation.inference.alternatives import Cancelling
    from dbbstation.inference.folds import HeldOut, KnownGains
    from dbbstation.inference.left_over import LeftOver
    from dbbstation.inference.levels import Levels
    from dbbstation.inference.read_off import CauseFinding
    from dbbstation.inference.settle import Settled
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource


CENTRED_SIGMA = 4.0
"""Centres were removed if all are within so many standard uncertainties of noise, or within `CENTRED_MM`."""

CENTRED_SHAPE = 25.0
"""... and if the form is this many times the smallest detectable centre."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Results of a comparison.

    Attributes:
        gains: of groups of tests; None if nothing was found or there are few groups.
        held_out: prediction errors with the stated set-up alone, and with findings [mm].
        effects: of the best set, by name, largest first.
        noticed_mm: detectable change of any strut's length.
    """

    matching: Matching
    settled: Settled
    findings: tuple[CauseFinding, ...]
    runs: tuple[RunDifference, ...]
    left: LeftOver
    gains: KnownGains | None
    held_out: tuple[HeldOut, HeldOut]
    effects: Mapping[str, EffectOfCause]
    noticed_mm: float
    lacking: Mapping[str, str]
    levels: Levels

    @property
    def probability(self) -> float:
        """Return the probability of a difference beyond noise and set-up, with even prior odds."""
        odds = np.array([cause.log_prior_odds for cause in self.settled.causes])
        nothing = float(-np.logaddexp(0.0, odds).sum())  # log prior probability that all are absent
        before = float(np.log(-np.expm1(nothing))) - nothing
        weights = self.settled.posterior.weights
        something = [weight for names, weight in weights.items() if names]
        return float(expit(logsumexp(something) - weights[frozenset()] - before))

    @property
    def differ(self) -> bool:
        """Return whether the sessions differ, by a sure cause or a structured residual."""
        return self.probability >= SURE or not self.left.is_noise

    @property
    def there(self) -> tuple[CauseFinding, ...]:
        """Return present causes' findings, largest first."""
        by_name = {finding.name: finding for finding in self.findings}
        return tuple(by_name[name] for name in self.effects)

    @cached_property
    def rms_mm(self) -> float:
        """Return the rms of smooth differences [mm]."""
        return rms(np.concatenate([run.smooth_mm for run in self.runs]))

    @property
    def cancelling(self) -> Cancelling | None:
        """Return cancelling effects [mm], or None."""
        settled = self.settled
        return cancelling({name: settled.effect([name]) for name in sorted(settled.best.names)}, "µm", 1e3)

    @property
    def found_rms_mm(self) -> float:
        """Return the rms effect of findings over all runs [mm]."""
        return rms(np.concatenate([run.found_mm for run in self.runs]))

    @property
    def directions(self) -> DirectionHalves | None:
        """Return the findings' parts as in `DirectionHalves`, or None."""
        both = np.array(
            [[self.runs[k].found_mm for k in runs] for runs in both_directions([run.pair for run in self.runs])]
        )
        if not len(both):
            return None
        return DirectionHalves(1e3 * rms(both.mean(axis=1)), 1e3 * rms(0.5 * (both[:, 0] - both[:, 1])))


@with_one_thread
def compare(
    machine: Machine,
    a: Sequence[Observation],
    b: Sequence[Observation],
    sources: Sequence[ErrorSource] = (),
    lacking: Mapping[str, str] | None = None,
    progress: Callable[[str], None] = lambda _: None,
    *,
    hold_out: bool = True,
) -> Comparison:
    """Compare two sessions.

    Args:
        sources: candidates whose inputs both sessions provide.
        hold_out: whether to repeat the selection without each group of tests.

    Raises:
        TraceError: no common run, or removed centres in one session.
    """
    for name, session in (("A", a), ("B", b)):
        _refuse_centred(name, session)
    matching = match(a, b)
    progress("candidates")
    sides = Sides.of(machine, matching.pairs)
    settled = settle(channel_of(sides, sources), in_time=False, rivals=False, progress=progress)
    progress("held-out tests")
    without, names = errors_of(sides, settled), settled.best.names
    parts = rows_of_groups(groups_of_tests([pair.test for pair in sides.pairs]), sides.blocks)
    limit = BOUNDS.expanded_of_table
    gains = gains_of_tests(settled, parts, lambda: without, most_expanded=limit) if hold_out else None
    refits = refits_without(settled, parts) if names else ()
    left = left_over(settled)
    levels = levels_by_tests(settled, left, gains)
    levels = replace(levels, follows=with_set_up(levels.follows, sides, settled))
    return Comparison(
        matching=matching,
        settled=settled,
        findings=read_off(settled, Trial(gains, refits), levels),
        levels=levels.times(1e3),
        gains=gains,
        runs=_runs(sides, settled),
        left=left,
        held_out=(without(names), without(())),
        effects=effects_of(sides, settled),
        noticed_mm=noticed_mm(settled),
        lacking=lacking or {},
    )


def _runs(sides: Sides, settled: Settled) -> tuple[RunDifference, ...]:
    members = settled.best.members
    samples, estimates = settled.bank.samples(all_columns(members)), settled.comparison.estimates(members)
    values, covariance = estimates.values, estimates.covariance
    found = sides.by_angle(samples @ values)
    out = []
    for pair, rows, order, own in zip(sides.pairs, sides.blocks, sides.orders, found, strict=True):
        norm = float(np.linalg.norm(own))
        towards = samples[rows].T @ (samples[rows] @ values) / max(norm, 1e-300)
        sigma = root(float(towards @ covariance @ towards))
        out.append(_run(pair, settled, rows, order, own, norm / sigma if sigma > 0.0 else 0.0))
    return tuple(out)


def _run(pair: Pair, settled: Settled, rows: slice, order: Integers, found: Floats, sigmas: float) -> RunDifference:
    theta, count = np.radians(pair.theta_deg), len(pair.theta_deg)
    low, _ = bands(count)
    row = coefficients(pair.difference_mm, theta, low)
    columns = basis(theta, low) / np.sqrt(count)
    first = [0, 1, low + 1]
    shape = row.copy()
    shape[first] = 0.0
    noise = settled.noise.effective
    sigma = np.sqrt(_stated(settled, rows, order, columns[:, first]) + noise**2)
    # A raised bar measures a radius change times the cosine of its elevation.
    per_mm = np.sqrt(count / 2.0) * float(np.cos(np.radians(pair.circle.elevation_deg)))
    smooth = columns @ row
    at = int(np.argmax(np.abs(smooth)))
    return RunDifference(
        test=pair.test,
        direction=str(pair.direction),
        number=pair.number,
        repeats_a=tuple(one.repeat for one in pair.a),
        repeats_b=tuple(one.repeat for one in pair.b),
        differs=sigmas >= OUT,
        found_rms_um=1e3 * rms(found),
        found_sigmas=sigmas,
        rms_um=1e3 * rms(smooth),
        noise_rms_um=1e3 * (noise * float(np.sqrt(len(row) / count))),
        centre_shift_um=(1e3 * float(row[1] / per_mm), 1e3 * float(row[low + 1] / per_mm)),
        centre_shift_uncertainty_um=1e3 * float(sigma[1:].max() / per_mm),
        mean_radial_change_um=1e3 * float(row[0] / np.sqrt(count)),
        mean_radial_change_uncertainty_um=1e3 * float(sigma[0] / np.sqrt(count)),
        circularity_um=1e3 * float(np.ptp(columns @ shape)),
        peak_um=1e3 * float(smooth[at]),
        peak_theta_deg=float(pair.theta_deg[at]),
        by_angle_um=_by_angle_um(pair.theta_deg, smooth),
        pair=pair,
        smooth_mm=smooth,
        found_mm=found,
    )


def _stated(settled: Settled, rows: slice, order: Integers, columns: Floats) -> Floats:
    """Return the variances of a run's constant, first cosine and first sine due to stated balls, bars and starts [mm²]."""
    base = settled.channel.base
    by_angle = np.empty((len(columns), len(base.prior)))
    by_angle[order] = base.samples[rows] * base.prior
    return np.sum((columns.T @ by_angle) ** 2, axis=1)


def _by_angle_um(theta_deg: Floats, smooth_mm: Floats) -> tuple[float, ...]:
    """Return 36 means over ten degrees each, from +X [µm]."""
    sector = (theta_deg * (BOUNDS.arcs_told / 360.0)).astype(np.int64)
    count = np.bincount(sector, minlength=BOUNDS.arcs_told)
    return tuple((1e3 * np.bincount(sector, smooth_mm, minlength=BOUNDS.arcs_told) / np.maximum(count, 1)).tolist())


def _refuse_centred(name: str, runs: Sequence[Observation]) -> None:
    if len(runs) < 2:  # noqa: PLR2004 - a single centre may be exact
        return
    for run in runs:
        found = figures(run.raw)
        rough = np.diff(run.raw.length_mm, 2) / np.sqrt(
            6.0
        )  # noise alone, because second differences of smooth values vanish
        limit = max(CENTRED_SIGMA * float(np.sqrt(2.0 * np.mean(rough**2) / len(run.raw))), CENTRED_MM)
        if 1e-3 * found.centre_deviation_um > limit or 1e-3 * found.circularity_um < CENTRED_SHAPE * limit:
            return
    raise TraceError(
        f"in session {name} all circles lie on their commanded centres within noise: their centres were removed",
        remedy="compare raw bar lengths; a circle without its centre has no position",
    )


def effects_of(sides: Sides, settled: Settled) -> dict[str, EffectOfCause]:
    """Return effects of the best set by name, largest evidence first."""
    comparison, best = settled.comparison, settled.best
    kinematic = _kinematic(sides)
    found = {}
    for member in sorted(best.members, key=lambda m: -best.log_factor(m.name)):
        name = member.name
        rows = settled.effect([name])
        share = comparison.explained([member]) / comparison.explained(best.members)
        taken_up = float(np.sum((kinematic.T @ rows) ** 2) / max(float(rows @ rows), 1e-300))
        found[name] = _placed(sides, rows, min(share, 1.0), taken_up)
    return found


def _placed(sides: Sides, rows: Floats, share: float, taken_up: float) -> EffectOfCause:
    by_run = sides.by_angle(rows)
    worst = int(np.argmax([np.abs(values).max() for values in by_run]))
    pair, values = sides.pairs[worst], by_run[worst]
    at, count = int(np.argmax(np.abs(values))), len(values)
    inside = values * np.sign(values[at]) >= 0.5 * abs(values[at])
    # The contiguous arc about the peak, across the turn's start.
    rolled = np.roll(inside, -at)
    ahead = count if rolled.all() else int(np.argmin(rolled))
    back = 0 if rolled.all() else int(np.argmin(rolled[::-1]))
    step = 360.0 / count
    first, last = (at - back) * step % 360.0, ((at + ahead) * step - 1e-9) % 360.0
    peak_um, run = 1e3 * float(values[at]), f"{pair.test} {pair.direction}"
    text = f"up to {peak_um:+.1f} µm in test {run}, {first:.0f} to {last:.0f} degrees"
    where = LargestEffect(pair.test, str(pair.direction), (first, last), peak_um, text)
    return EffectOfCause(1e3 * rms(rows), share, taken_up, opposite_share(sides, by_run), where)


def opposite_share(sides: Sides, by_run: list[Floats]) -> float:
    """Return the share of squares that change sign with direction."""
    same, opposite = 0.0, 0.0
    for one, other in both_directions(sides.pairs):
        same += float(np.sum((by_run[one] + by_run[other]) ** 2))
        opposite += float(np.sum((by_run[one] - by_run[other]) ** 2))
    return opposite / (same + opposite) if same + opposite > 0.0 else 0.0


def both_directions(pairs: Sequence[Pair]) -> list[tuple[int, int]]:
    """Return the runs of tests measured in both directions."""
    by_test = grouped(((pair.test, pair.number), k) for k, pair in enumerate(pairs))
    return [(runs[0], runs[1]) for runs in by_test.values() if len(runs) == 2]  # noqa: PLR2004


def _kinematic(sides: Sides) -> Floats:
    """Return an orthonormal basis of kinematic effects on B's readings, shape (n, k)."""
    sources = sources_named(KINEMATIC_SOURCES)
    columns = [
        np.hstack([reading.by_source(s, sides.machine, np.zeros(len(s.parameters(sides.machine)))) for s in sources])
        for reading in sides.readings[1]
    ]
    axes, sizes, _ = np.linalg.svd(sides.averaged(1, columns), full_matrices=False)
    return axes[:, sizes > ROUNDING * sizes[0]]


def noticed_mm(settled: Settled) -> float:
    """Return the detectable change of length for the least visible strut [mm]."""
    cause = next(cause for cause in settled.causes if cause.name == "strut-reference-length")
    single = [v.columns for v in cause.variants if len(v.columns) == 1 and v.label.startswith("strut")]
    products = [float(settled.comparison.beside((), columns)[0, 0]) for columns in single]
    return OUT / float(np.sqrt(max(min(products), 1e-300)))


def errors_of(sides: Sides, settled: Settled) -> Callable[[Collection[str]], HeldOut]:
    """Return a function that predicts held-out tests with stated set-ups, and with all found causes but some."""
    bank, channel, members = settled.bank, settled.channel, settled.best.members
    columns, known = bank.jointly(members)
    every, target = np.arange(len(known.prior)), bank.target
    blocks = [compress(every, columns[rows], target[rows]) for rows in sides.blocks]
    tests, widths = [pair.test for pair in sides.pairs], {member.name: len(member.columns) for member in members}
    return errors_without(blocks, tests, known, widths, settled.noise.innovation, channel.held)


SAME_TEMPERATURE_K = 0.5
"""Smaller differences of mean temperature are not reported: a bar of 150 mm grows by less than 1 µm."""


def notes_of(machine_a: Machine, machine_b: Machine, pairs: Sequence[Pair]) -> list[str]:
    """Return sentences on different machines, balls, programs, feeds and temperatures."""
    return [*_machines(machine_a, machine_b), *_balls(pairs), *_programs(pairs), *_feeds(pairs), *_temperatures(pairs)]


def _machines(a: Machine, b: Machine) -> list[str]:
    unlike = [
        name
        for name, one, other in (
            ("base joints", a.hexapod.base_joints_mm, b.hexapod.base_joints_mm),
            ("platform joints", a.hexapod.platform_joints_mm, b.hexapod.platform_joints_mm),
            ("reference lengths", a.reference_length_error_mm, b.reference_length_error_mm),
        )
        if not np.array_equal(one, other)
    ]
    if a.hexapod.rotation != b.hexapod.rotation:
        unlike.append("order of the tilt angles")
    if not unlike:
        return []
    names = f"{a.name} in A, {b.name} in B" if a.name != b.name else a.name
    return [
        (
            f"the nominal machines differ ({', '.join(unlike)}; {names}): differences of readings contain what the control's "
            "parameters were changed by; strut sensitivities are those of A"
        )
    ]


def _balls(pairs: Sequence[Pair]) -> list[str]:
    apart = {
        pair.test: 1e3 * float(np.abs(np.subtract(pair.a[0].raw.circle.ball_mm, pair.b[0].raw.circle.ball_mm)).max())
        for pair in pairs
    }
    worst = max(apart, key=lambda test: apart[test])
    notes = []
    if apart[worst] > 0.0:
        notes.append(
            f"the CMM sheets have other ball centres, by up to {apart[worst]:.1f} µm (test {worst}): each session is read "
            "about its own, so that differences contain what is wrong in either sheet"
        )
    lost = sorted({pair.test for pair in pairs for run in (*pair.a, *pair.b) if not run.setup.place_known})
    if lost:
        notes.append(f"the places of the balls of {', '.join(lost)} are unknown: centre shifts there do not count")
    return notes


def _programs(pairs: Sequence[Pair]) -> list[str]:
    by_program = [
        sum(any(run.commanded is not None for run in runs) for runs in side)
        for side in ([pair.a for pair in pairs], [pair.b for pair in pairs])
    ]
    if by_program[0] == by_program[1] == 0:
        return []
    return [
        (
            f"{by_program[0]} runs of A and {by_program[1]} of B were commanded by programs of their own: readings are held "
            "against the planned circle, so that differences contain what the programs compensate"
        )
    ]


def _feeds(pairs: Sequence[Pair]) -> list[str]:
    feeds = [(p.a[0].raw.circle.feed_mm_min, p.b[0].raw.circle.feed_mm_min) for p in pairs]
    unlike = [pair for pair in feeds if pair[0] != pair[1]]
    if not unlike:
        return []
    return [f"{len(unlike)} runs were travelled at other feeds, such as {unlike[0][0]:g} and {unlike[0][1]:g} mm/min"]


def _temperatures(pairs: Sequence[Pair]) -> list[str]:
    of_a = _means([run.raw.temperature_degc for pair in pairs for run in pair.a])
    of_b = _means([run.raw.temperature_degc for pair in pairs for run in pair.b])
    return [
        f"mean temperature of {sensor}: {of_a[sensor]:.1f} degC in A, {of_b[sensor]:.1f} degC in B"
        for sensor in of_a
        if sensor in of_b and abs(of_b[sensor] - of_a[sensor]) > SAME_TEMPERATURE_K
    ]


def _means(logs: Sequence[Mapping[str, Floats]]) -> dict[str, float]:
    sensors = set.intersection(*(set(log) for log in logs))
    return {sensor: float(np.mean([log[sensor].mean() for log in logs])) for sensor in sorted(sensors)}
