"""Compare two sessions and explain their difference."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import expit, logsumexp

from dbbstation.calibration.fit.methods import CENTRED_MM
from dbbstation.computing.threads import with_one_thread
from dbbstation.diagnosis.compare.channel import channel_of
from dbbstation.diagnosis.compare.details import both_directions, effects_of, noticed_mm
from dbbstation.diagnosis.compare.findings import DirectionHalves, RunDifference
from dbbstation.diagnosis.compare.left_out import predicted, tried_without_tests
from dbbstation.diagnosis.compare.pairs import match
from dbbstation.diagnosis.compare.set_up import with_set_up
from dbbstation.diagnosis.compare.sides import Sides
from dbbstation.errors import TraceError
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.cancelling import cancelling
from dbbstation.inference.harmonics import bands, basis, coefficients
from dbbstation.inference.left_over import left_over
from dbbstation.inference.levels_of import levels_by_tests
from dbbstation.inference.model_comparison import all_columns
from dbbstation.inference.read_off import read_off
from dbbstation.inference.settle import settle
from dbbstation.inference.triangle import rms, root
from dbbstation.inference.verdict import OUT, SURE
from dbbstation.trace.analysis import figures

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.diagnosis.compare.findings import EffectOfCause
    from dbbstation.diagnosis.compare.pairs import Matching, Pair
    from dbbstation.inference.cancelling import Cancelling
    from dbbstation.inference.held_out import HeldOut
    from dbbstation.inference.left_over import LeftOver
    from dbbstation.inference.levels import Levels
    from dbbstation.inference.read_off import CauseFinding, Trial
    from dbbstation.inference.settled import Settled
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
        trial: evidence of groups of tests; without predictions if nothing was found or there are few groups.
        held_out: prediction errors with the stated set-up alone, and with findings [mm].
        effects: of the best set, by name, largest first.
        noticed_mm: detectable change of any strut's length.
    """

    matching: Matching
    settled: Settled
    findings: tuple[CauseFinding, ...]
    runs: tuple[RunDifference, ...]
    left: LeftOver
    trial: Trial
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
    trial, gains = tried_without_tests(sides, settled, hold_out=hold_out)
    left = left_over(settled)
    levels = levels_by_tests(settled, left, gains)
    levels = replace(levels, follows=with_set_up(levels.follows, sides, settled))
    return Comparison(
        matching=matching,
        settled=settled,
        findings=read_off(settled, trial, levels),
        levels=levels.times(1e3),
        trial=trial,
        runs=_runs(sides, settled),
        left=left,
        held_out=(predicted(sides, settled, ()), predicted(sides, settled, settled.best.members)),
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
