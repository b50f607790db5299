"""Fit the classical signatures of serial axes to a circle by least squares.

On a hexapod they are symptoms, not causes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import block_diag

from dbbstation.circles.noise import LEAST_UM
from dbbstation.computing.arrays import average_of, hypot_of
from dbbstation.computing.threads import with_one_thread
from dbbstation.facts.serialise import OrNull
from dbbstation.inference.harmonics import LOW, basis, misfit
from dbbstation.trace.recording import means, sector_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.circles.analysis import CircleAnalysis
    from dbbstation.computing.arrays import Floats
    from dbbstation.plan.plan import Circle


SECTORS = 2880
"""Longer recordings are averaged over an eighth of a degree. The shortest signature, a cyclic error of 40 periods over
the diameter, loses 0.3 % of its amplitude."""

SPIKES_DEG = (1.5, 2.1, 3.0, 4.2, 6.0, 8.5, 12.0)
"""Tried lengths of reversal spikes, equal at all four ends [deg]; figures are means over them."""

FINER = (2.0**0.2, 2.0**0.06)
"""Ratios between tried lengths about the most likely one, in successive rounds."""

FREE = 10
"""Highest undulations, from 3 per revolution, of the form common to both directions. The form of any machine is fitted
with the signatures, so they do not absorb it, and not reported."""

PERIODS = np.arange(6.0, 40.01, 0.25)
"""Tried periods of a cyclic error over the diameter. Fewer periods cannot be separated from form. A peak of the scan is
a quarter of a period wide."""

AT_END_DEG = 0.3
"""Excluded arc on each side of an axis end [deg]: start angle and ball place leave the side of a step uncertain."""

SEEN = 4.0
"""Standard uncertainties of a significant figure: by chance one of 1400 results with 11 figures has one (normal)."""

ONE_SIDED = 1.645
"""Standard deviations of a 95 % bound [normal distribution]."""

CHANCE = 1e-3
"""Probability that noise alone gives a cyclic error in the scan."""

FEWEST = 200
"""Fewest samples of a turn: a spike of 1.5 degrees must contain one."""


@dataclass(frozen=True)
class Symptom:
    """Size of one signature.

    Attributes:
        place: end or axis; empty for both.
        value: None if undetermined.
        below: 95 % bound if not significant, else None.
    """

    signature: Signature
    place: OrNull
    value: float | None
    u: float | None
    below: float | None
    unit: str
    seen: bool
    text: OrNull = ""


@dataclass(frozen=True)
class QuickLook:
    """All signatures of one circle.

    Attributes:
        left_rms_um: residual rms, with noise.
        sigma_um: white noise per sample with the actual noise's effect on signatures.
    """

    symptoms: tuple[Symptom, ...]
    form_rms_um: float
    left_rms_um: float
    spike_deg: float
    sigma_um: float


@dataclass(frozen=True, eq=False)
class _Turn:
    one: CircleAnalysis
    theta_deg: Floats
    deviation_um: Floats


@dataclass(frozen=True, eq=False)
class _Fit:
    shapes: tuple[SignatureColumn, ...]
    value: Floats
    unit_covariance: Floats
    left_um: Floats
    basis: Floats
    spike_deg: float


@with_one_thread
def quick_look(turns: Sequence[CircleAnalysis]) -> QuickLook | None:
    """Fit signatures to one or both directions.

    The fit includes each turn's centre and radius, and a common form of 3 to 10 undulations. The residual counts as
    noise that is white up to 30 undulations per revolution. One direction cannot separate squareness from servo
    mismatch; the result then lacks both.

    Args:
        turns: one turn, or two of opposite sense.

    Returns:
        None if a turn has too few samples.
    """
    if min(len(one.raw) for one in turns) < FEWEST:
        return None
    cut = [_turn(one) for one in turns]
    fit = _best(_fits(cut))
    waves = {axis: _cyclic(cut, fit, axis) for axis in ("X", "Y")}
    strongest, other = sorted(waves, key=lambda axis: waves[axis][1].gained, reverse=True)
    shown = [waves[strongest][1].columns] if waves[strongest][0].seen else []
    if shown:
        fit = _fitted(cut, fit.spike_deg, shown)
        waves[other] = _cyclic(cut, fit, other)
        shown += [waves[other][1].columns] if waves[other][0].seen else []
    fits = _fits(cut, shown)
    fit = _best(fits)
    sigma_um = _sigma_um(cut, fit)
    return QuickLook(
        symptoms=(*_symptoms(fits, sigma_um, both=len(turns) > 1), *(waves[axis][0] for axis in sorted(waves))),
        form_rms_um=_rms(np.concatenate([turn.deviation_um for turn in cut])),
        left_rms_um=_rms(fit.left_um),
        spike_deg=fit.spike_deg,
        sigma_um=sigma_um,
    )


def _turn(one: CircleAnalysis) -> _Turn:
    theta_deg, deviation = one.path.theta_deg, one.residual_um
    if len(one.raw) > SECTORS:
        sector = sector_of(one.raw, SECTORS)
        phi_deg = means(one.raw.phi_deg, sector)
        away_deg = np.mod(theta_deg - one.raw.theta_deg + 180.0, 360.0) - 180.0  # about the ball less commanded
        theta_deg = np.mod(one.raw.circle.theta_deg(phi_deg) + means(away_deg, sector), 360.0)
        deviation = means(deviation, sector)
    inside = np.abs(np.mod(theta_deg + 45.0, 90.0) - 45.0) > AT_END_DEG
    return _Turn(one, theta_deg[inside], deviation[inside])


def _fits(turns: Sequence[_Turn], waves: Sequence[Floats] = ()) -> list[_Fit]:
    found = [_fitted(turns, spike_deg, waves) for spike_deg in SPIKES_DEG]
    for finer in FINER:
        middle = _best(found).spike_deg
        lengths = [middle * finer**step for step in (-2, -1, 1, 2)]
        found += [_fitted(turns, length, waves) for length in lengths if SPIKES_DEG[0] <= length <= SPIKES_DEG[-1]]
    return sorted(found, key=lambda one: one.spike_deg)


def _best(fits: Sequence[_Fit]) -> _Fit:
    return min(fits, key=lambda one: float(one.left_um @ one.left_um))


def _over_lengths(fits: Sequence[_Fit], sigma_um: float) -> tuple[Floats, Floats]:
    """Return values and standard uncertainties averaged over spike lengths, shapes (k,)."""
    # Weights are marginal likelihoods: exp(-squares / 2 s²) times the root of the covariance determinant [law of total
    # variance; Hoeting et al., Stat. Sci. 14 (1999), eqs 2, 3]. A single best length would fit noise.
    squares = np.array([one.left_um @ one.left_um for one in fits]) / sigma_um**2
    spread = np.array([np.linalg.slogdet(one.unit_covariance)[1] for one in fits])
    # Likely lengths are tried more densely, so each is weighted by its part of the logarithmic scale.
    part = np.gradient(np.log([one.spike_deg for one in fits]))
    log_weight = 0.5 * (spread - squares) + np.log(np.maximum(part, np.finfo(float).tiny))
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    values = np.array([one.value for one in fits])
    variances = sigma_um**2 * np.array([np.diag(one.unit_covariance) for one in fits])
    mean = weight @ values
    return mean, np.sqrt(weight @ (variances + (values - mean) ** 2))


def _fitted(turns: Sequence[_Turn], spike_deg: float, waves: Sequence[Floats] = ()) -> _Fit:
    each = [shapes_of(turn.theta_deg, turn.one.raw.circle, spike_deg) for turn in turns]
    shapes = [shape for shape in each[0] if len(turns) > 1 or shape.signature is not Signature.SERVO]
    sizes = np.column_stack([np.concatenate([of[shape] for of in each]) for shape in shapes])
    columns = np.hstack([sizes, *waves, _beside(turns)])
    values = np.concatenate([turn.deviation_um for turn in turns])
    basis, upper = np.linalg.qr(columns)
    inverse = np.linalg.inv(upper)
    found = inverse @ (basis.T @ values)
    kept = len(shapes)
    return _Fit(
        shapes=tuple(shapes),
        value=found[:kept],
        unit_covariance=(inverse @ inverse.T)[:kept, :kept],
        left_um=values - columns @ found,
        basis=basis,
        spike_deg=spike_deg,
    )


def _beside(turns: Sequence[_Turn]) -> Floats:
    waves = [basis(np.radians(turn.theta_deg), FREE) for turn in turns]
    circle = [0, 1, FREE + 1]
    form = [k for k in range(2 * FREE + 1) if k not in {*circle, 2, FREE + 2}]
    return np.hstack([block_diag(*(wave[:, circle] for wave in waves)), np.vstack([wave[:, form] for wave in waves])])


def _sigma_um(turns: Sequence[_Turn], fit: _Fit) -> float:
    ends = np.cumsum([len(turn.theta_deg) for turn in turns])[:-1]
    found = misfit(
        np.split(fit.left_um, ends),
        [np.radians(turn.theta_deg) for turn in turns],
        range(len(turns)),
        # The test itself subtracts each turn's radius and centre.
        freedom_used=float(fit.basis.shape[1] - 2 * len(turns)),
    )
    per_undulation = average_of([len(turn.theta_deg) for turn in turns]) / (2.0 * LOW)
    rounding = average_of([turn.one.noise.resolution_um**2 / 12.0 for turn in turns])
    return sqrt(max(found.noise**2, rounding, LEAST_UM**2) + found.rms**2 * max(per_undulation, 1.0))


def _symptoms(fits: Sequence[_Fit], sigma_um: float, *, both: bool) -> list[Symptom]:
    fit = _best(fits)
    values, u = _over_lengths(fits, sigma_um)
    found = [
        Symptom(
            shape.signature, shape.place, float(value), float(each), None, shape.unit, bool(abs(value) > SEEN * each)
        )
        for shape, value, each in zip(fit.shapes, values, u, strict=True)
    ]
    if both:
        return [_with_length(one, fit) for one in found]
    why = "one direction cannot separate squareness from servo mismatch"
    mixed = [
        Symptom(signature, "", None, None, None, unit, seen=False, text=why)
        for signature, unit in ((Signature.SQUARENESS, "µm/m"), (Signature.SERVO, "ms"))
    ]
    return [*mixed, *(_with_length(one, fit) for one in found if one.signature is not Signature.SQUARENESS)]


def _with_length(one: Symptom, fit: _Fit) -> Symptom:
    return replace(one, text=f"most likely over {fit.spike_deg:g}°") if one.signature is Signature.SPIKE else one


@dataclass(frozen=True, eq=False)
class _Wave:
    gained: float
    period_mm: float
    size: Floats
    columns: Floats
    beside: Floats


def _cyclic(turns: Sequence[_Turn], fit: _Fit, axis: str) -> tuple[Symptom, _Wave]:
    diameter_mm = 2.0 * turns[0].one.raw.circle.radius_mm

    def trial(periods: float) -> _Wave:
        period_mm = diameter_mm / periods
        waves = np.vstack([cyclic_shapes(turn.theta_deg, turn.one.raw.circle, axis, period_mm) for turn in turns])
        beside = waves - fit.basis @ (fit.basis.T @ waves)
        size = np.asarray(np.linalg.solve(beside.T @ beside, beside.T @ fit.left_um), dtype=np.float64)
        return _Wave(float(fit.left_um @ beside @ size), period_mm, size, waves, beside)

    coarse = max((trial(float(periods)) for periods in PERIODS), key=lambda one: one.gained)
    near = diameter_mm / coarse.period_mm
    step = float(PERIODS[1] - PERIODS[0])
    from scipy.optimize import minimize_scalar  # noqa: PLC0415 - a quarter of a second, needed only here

    fine = minimize_scalar(lambda periods: -trial(periods).gained, bounds=(near - step, near + step), method="bounded")
    found = max(coarse, trial(float(fine.x)), key=lambda one: one.gained)
    size, beside = found.size, found.beside
    sigma_um = _sigma_um(turns, replace(fit, left_um=fit.left_um - beside @ size))
    covariance = sigma_um**2 * np.linalg.inv(beside.T @ beside)
    amplitude = hypot_of(*size)
    along = size / max(amplitude, np.finfo(float).tiny)
    across = np.array([-along[1], along[0]])
    u = sqrt(along @ covariance @ along)
    # Half of the reduction of squares is exponentially distributed in each trial [two degrees of freedom].
    limit = 2.0 * float(np.log(2 * len(PERIODS) / CHANCE)) * sigma_um**2
    if found.gained <= limit:
        # The strongest of many insignificant waves is no estimate, but an upper bound.
        below = amplitude + ONE_SIDED * u
        symptom = Symptom(Signature.CYCLIC, axis, None, None, below, "µm", seen=False, text=f"below {below:.2g} µm")
        return symptom, found
    # Noise perpendicular to a wave's phasor lengthens it by variance over twice its size.
    size_um = sqrt(max(amplitude**2 - across @ covariance @ across, 0.0))
    symptom = Symptom(Signature.CYCLIC, axis, size_um, u, None, "µm", seen=True, text=f"every {found.period_mm:.1f} mm")
    return symptom, found


def _rms(values: Floats) -> float:
    return sqrt(np.mean(values**2))


class Signature(StrEnum):
    """The classical signatures."""

    SQUARENESS = "squareness"
    SCALE = "scale mismatch"
    SERVO = "servo mismatch"
    BACKLASH = "backlash step"
    SPIKE = "reversal spike"
    CYCLIC = "cyclic error"


ENDS = {"+X": 0.0, "+Y": 90.0, "-X": 180.0, "-Y": 270.0}
"""Angles at which an axis reverses [deg]."""


@dataclass(frozen=True)
class SignatureColumn:
    """One column of the fit.

    Attributes:
        place: end or axis; empty for both.
    """

    signature: Signature
    place: str
    unit: str


def shapes_of(theta_deg: Floats, circle: Circle, spike_deg: float) -> dict[SignatureColumn, Floats]:
    """Return the deviations by unit signatures [µm], shape (n,) each; docs/circles.md has the formulas.

    They are radial, outwards positive, over θ from +X towards +Y. To first order, errors e_x, e_y cause
    e_x cos θ + e_y sin θ.

    Args:
        theta_deg: shape (n,).
        circle: radius, feed, sense.
    """
    theta, sign = np.radians(theta_deg), circle.direction.sign
    radius_mm = circle.radius_mm
    cosine, sine = np.cos(theta), np.sin(theta)
    feed_um_ms = circle.feed_mm_min / 60.0
    found = {
        SignatureColumn(Signature.SQUARENESS, "", "µm/m"): -5e-4 * radius_mm * np.sin(2.0 * theta),
        SignatureColumn(Signature.SCALE, "", "µm/m"): 5e-4 * radius_mm * np.cos(2.0 * theta),
        SignatureColumn(Signature.SERVO, "", "ms"): 0.5 * sign * feed_um_ms * np.sin(2.0 * theta),
    }
    along = {"X": (cosine, -sign * sine), "Y": (sine, sign * cosine)}
    for end in ENDS:
        at, speed = along[end[1]]
        share = 0.5 * (1.0 + at) if end[0] == "+" else 0.5 * (1.0 - at)
        found[SignatureColumn(Signature.BACKLASH, end, "µm")] = -0.5 * np.sign(speed) * at * share
    for end, end_deg in ENDS.items():
        behind = np.mod(sign * (theta_deg - end_deg), 360.0)
        found[SignatureColumn(Signature.SPIKE, end, "µm")] = np.where(
            behind < spike_deg, np.sin(np.pi * np.minimum(behind / spike_deg, 1.0)), 0.0
        )
    return found


def cyclic_shapes(theta_deg: Floats, circle: Circle, axis: str, period_mm: float) -> Floats:
    """Return deviations by unit sine and cosine errors, periodic in an axis's position from the centre, shape (n, 2) [µm].

    Args:
        theta_deg: shape (n,).
        axis: `X` or `Y`.
    """
    theta = np.radians(theta_deg)
    along = np.cos(theta) if axis == "X" else np.sin(theta)
    phase = 2.0 * np.pi * circle.radius_mm / period_mm * along
    return np.column_stack([along * np.sin(phase), along * np.cos(phase)])
