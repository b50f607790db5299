"""Joint fit of mass, viscous friction and members."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.linalg import spsolve_triangular
from scipy.special import log_ndtr

from dbbstation.diagnosis.drive.channel import BASE_UNITS, MASS
from dbbstation.facts.value import Value
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.channel import NEGATIVE_SIGMA
from dbbstation.inference.levels import OUT
from dbbstation.inference.model_comparison import slices_of
from dbbstation.inference.read_off import values_of_law
from dbbstation.inference.triangle import ROUNDING, root, triangle_of

if TYPE_CHECKING:
    from collections.abc import Container, Sequence

    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.diagnosis.drive.channel import DriveChannel
    from dbbstation.inference.channel import Law
    from dbbstation.inference.model_comparison import Member
    from dbbstation.inference.settle import Settled

METHOD_U_SHARE = 5e-4
"""Relative standard uncertainty of values of a perfect recording, by low-pass, differences and times of reversals; on
simulated drives the mass is too small by half of this."""

LIKELY = 0.01
"""Least probability of hypotheses that contribute to the uncertainty of common parameters."""


@dataclass(frozen=True, eq=False)
class DriveFit:
    """A fit of base, then amplitudes and slack of members."""

    drive: DriveChannel
    members: tuple[Member, ...]
    samples: Floats
    values: Floats
    covariance: Floats

    @property
    def base(self) -> dict[str, Value]:
        """Return base parameters by name."""
        sigma = np.sqrt(np.diag(self.covariance))
        return {
            name: Value(float(self.values[k]), float(sigma[k]), BASE_UNITS[name])
            for k, name in enumerate(self.drive.channel.base.names)
        }

    @cached_property
    def own(self) -> dict[str, tuple[Member, slice]]:
        """Return members by name, with their columns."""
        places = slices_of(self.members, len(self.drive.channel.base.names))
        return {member.name: (member, place) for member, place in zip(self.members, places, strict=True)}

    @property
    def laws(self) -> list[str]:
        """Return the members that are laws."""
        return [name for name in self.own if name in self.drive.of_law]

    def columns_of(self, name: str) -> slice:
        """Return a member's amplitude columns."""
        member, own = self.own[name]
        return slice(own.start, own.start + member.width)

    def _law(self, name: str) -> Law:
        return next(law for law in self.drive.channel.laws if law.name == name)

    def parameters(self, name: str) -> dict[str, Value]:
        """Return a law's amplitudes and nonlinear parameters; without tangent, a parameter's uncertainty is its grid's last value."""
        law, (member, own) = self._law(name), self.own[name]
        found = values_of_law(law, member, self.values[own], self.covariance[own, own], METHOD_U_SHARE)
        ends = dict(zip(law.parameters[len(law.plausible) :], (grid[-1] for grid in law.grids), strict=True))
        return {n: v if np.isfinite(v.uncertainty) else replace(v, uncertainty=ends[n]) for n, v in found.items()}

    def at_end(self, name: str) -> dict[str, tuple[float, float]]:
        """Return a law's nonlinear parameters that are at a limit of their grid, with these limits."""
        law, found = self._law(name), self.parameters(name)
        grids = zip(law.parameters[len(law.plausible) :], law.grids, strict=True)
        ends = {shape: (grid[0], grid[-1]) for shape, grid in grids if len(grid) > 1}
        return {k: (low, high) for k, (low, high) in ends.items() if not low < found[k].value < high}

    def all_values(self) -> dict[str, float]:
        """Return all parameters of base and laws by name."""
        found = {name: value.value for name, value in self.base.items()}
        for law in self.laws:
            found |= {name: value.value for name, value in self.parameters(law).items()}
        return found

    def force_n(self, names: Container[str] | None = None) -> Floats:
        """Return the force of base and members at compared samples, shape (m,) [N]; None for all members."""
        used = np.zeros(len(self.values), dtype=bool)
        used[: len(self.drive.channel.base.names)] = True
        for name, (_, own) in self.own.items():
            if names is None or name in names:
                used[own] = True
        return self.samples[:, used] @ self.values[used]

    def weighted(self, weights: Floats, unit: str) -> Value:
        """Return a weighted sum of values, weights of shape (k,)."""
        sigma = root(float(weights @ self.covariance @ weights))
        return Value(float(weights @ self.values), sigma, unit)

    @property
    def impossible(self) -> list[str]:
        """Return significantly negative base parameters, worst first."""
        below = {name: -v.value / v.uncertainty for name, v in self.base.items() if v.uncertainty > 0.0}
        return [n for n, s in sorted(below.items(), key=lambda item: -item[1]) if s > NEGATIVE_SIGMA]


def fit(drive: DriveChannel, settled: Settled, members: Sequence[Member], rows: Flags | None = None) -> DriveFit:
    """Fit base and members under priors."""
    channel, bank = drive.channel, settled.bank
    samples = np.hstack([channel.base.samples, *(bank.samples(member.columns) for member in members)])
    rows = np.ones(len(samples), dtype=bool) if rows is None else rows
    white = bank.whitened(np.column_stack([samples, channel.residual]))[rows]
    values, covariance = _solved(white, _prior_sd(drive, members), settled.noise.innovation)
    return DriveFit(drive, tuple(members), samples, values, covariance)


def _prior_sd(drive: DriveChannel, members: Sequence[Member]) -> Floats:
    """Return prior standard deviations, shape (k,)."""
    return np.concatenate([np.full(len(drive.channel.base.names), np.inf), *(member.sd for member in members)])


def _solved(rows: Floats, sd: Floats, noise: float) -> tuple[Floats, Floats]:
    rows = triangle_of(rows)  # equivalent, with as many rows as columns
    norm = np.linalg.norm(rows[:, :-1], axis=0)
    norm = np.where(norm > 0.0, norm, 1.0)  # a pulse elsewhere is determined only by its prior
    stacked = np.vstack([rows[:, :-1] / norm, np.diag(noise / sd / norm)])
    target = np.concatenate([rows[:, -1], np.zeros(len(sd))])
    u, s, vt = np.linalg.svd(stacked, full_matrices=False)
    s = np.maximum(s, ROUNDING * s[0])
    root = (vt.T / s) / norm[:, None]
    return root @ (u.T @ target), noise**2 * (root @ root.T)


def measured(drive: DriveChannel, settled: Settled, members: Sequence[Member]) -> DriveFit:
    """Return the fit for reported values, with cautious uncertainties."""
    # Whitening emphasises changes of force, where friction laws are least exact. Ordinary least squares is more robust
    # and is used if both differ beyond noise [Hausman, Specification tests in econometrics, Econometrica 46 (1978)
    # 1251, sec. 2], with coloured covariance [Huber, Proc. 5th Berkeley Symp. 1 (1967) 221].
    bank, sd = settled.bank, _prior_sd(drive, members)
    white = fit(drive, settled, members)
    rows = np.column_stack([white.samples, drive.channel.residual])
    # Relative to priors, rows are weighted by their noise at low frequencies.
    counted = settled.noise.effective
    values, covariance = _solved(rows, sd, counted)
    covariance = covariance @ _information(settled, white.samples, sd, counted) @ covariance
    plain = replace(white, values=values, covariance=0.5 * (covariance + covariance.T))
    if _differ_by(white, plain) > OUT:
        return _widened(settled, plain, rows, sd, counted)
    return _widened(settled, white, bank.whitened(rows), sd, settled.noise.innovation)


def _differ_by(efficient: DriveFit, plain: DriveFit) -> float:
    """Return the greatest standardised difference between both estimates."""
    # Its variance is the difference of variances [Hausman 1978, corollary 2.6].
    told = list(range(len(efficient.drive.channel.base.names)))
    for law in efficient.laws:
        own = efficient.columns_of(law)
        told += range(own.start, own.stop)
    every = np.diag(plain.covariance) - np.diag(efficient.covariance)
    known = [k for k in told if every[k] > ROUNDING * plain.covariance[k, k]]
    apart = np.abs(plain.values - efficient.values)[known] / np.sqrt(every[known])
    return float(apart.max(initial=0.0))


def _widened(settled: Settled, fitted: DriveFit, rows: Floats, sd: Floats, noise: float) -> DriveFit:
    """Widen the fit's uncertainties to include results without each stretch and with half the bandwidth."""
    # Noise alone understates them [Efron and Stein, The jackknife estimate of variance, Ann. Statist. 9 (1981) 586, eq.
    # 1.5].
    stretch = np.arange(len(rows)) * BOUNDS.folds // len(rows)
    each = [triangle_of(rows[stretch == k]) for k in range(BOUNDS.folds)]
    others = (np.vstack([*each[:k], *each[k + 1 :]]) for k in range(BOUNDS.folds))
    every = np.array([_solved(one, sd, noise)[0] for one in others])
    moves = (BOUNDS.folds - 1.0) / BOUNDS.folds * np.sum((every - every.mean(axis=0)) ** 2, axis=0)
    # If only one stretch shows a pulse, its omission gives no information.
    everywhere = np.array([np.any(fitted.samples[stretch != k] != 0.0, axis=0) for k in range(BOUNDS.folds)]).all(
        axis=0
    )
    variance = np.maximum(np.diag(fitted.covariance), 1e-300)
    wider = np.sqrt(np.where(everywhere, np.maximum(moves / variance, 1.0), 1.0))
    # A value may be anywhere between the results of both bands, or equally far on the other side.
    slow = _in_half_the_band(settled, fitted)
    wider = np.sqrt(
        wider**2 + np.maximum((slow.values - fitted.values) ** 2 - np.diag(slow.covariance), 0.0) / 3.0 / variance
    )
    return replace(fitted, covariance=fitted.covariance * np.outer(wider, wider))


def _information(settled: Settled, samples: Floats, sd: Floats, counted: float) -> Floats:
    """Return the covariance of columns times coloured noise, with priors, shape (k, k)."""
    # Rows are divided by the square of the `counted` noise.
    bank = settled.bank
    taken = samples
    if bank.whitening is not None:
        # Noise is the innovation times the inverse whitening; this is its transpose.
        taken = spsolve_triangular(bank.whitening.T.tocsr(), samples, lower=False)
    return (settled.noise.innovation / counted**2) ** 2 * taken.T @ taken + np.diag(1.0 / sd**2)


def _in_half_the_band(settled: Settled, fitted: DriveFit) -> DriveFit:
    even = len(fitted.samples) // 2 * 2
    rows = np.column_stack([fitted.samples, fitted.drive.channel.residual])[:even]
    halved = rows.reshape(-1, 2, rows.shape[1]).mean(axis=1)
    noise = settled.noise.effective / float(np.sqrt(2.0))
    values, covariance = _solved(halved, _prior_sd(fitted.drive, fitted.members), noise)
    return replace(fitted, values=values, covariance=covariance)


def log_possible(fitted: DriveFit) -> float:
    """Return the log probability of non-negative mass and friction."""
    return float(sum(log_ndtr(v.value / max(v.uncertainty, 1e-300)) for v in fitted.base.values()))


def base_values(drive: DriveChannel, settled: Settled, best: DriveFit) -> dict[str, Value]:
    """Return base parameters with uncertainty over likely hypotheses."""
    posterior = settled.posterior
    shares = dict(zip(posterior.weights, posterior.shares.tolist(), strict=True))
    likely = [(shares[h.names], h) for h in posterior.hypotheses[1 : BOUNDS.likely_sets]]
    fits = [(p, measured(drive, settled, h.members).base) for p, h in likely if p > LIKELY]
    found = {}
    for name, value in best.base.items():
        between = sum(p * (base[name].value - value.value) ** 2 for p, base in fits)
        # A force averaged over the span of the differences is attenuated like them, an instantaneous force is not.
        # Recordings do not show which applies [rectangular distribution: JCGM 100:2008, sec. 4.3.7].
        lost = drive.recordings.lost_share / np.sqrt(3.0) if name == MASS else 0.0
        share = np.hypot(METHOD_U_SHARE, lost)
        sigma = float(np.sqrt(value.uncertainty**2 + between + (share * value.value) ** 2))
        found[name] = Value(value.value, sigma, value.unit)
    return found
