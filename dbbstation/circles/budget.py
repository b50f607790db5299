"""What is known to be uncertain in the figures of a circle: one term per cause, and the causes that nobody stated."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from dbbstation.circles.noise import ROUNDING
from dbbstation.trace.gaussian import gaussian

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.circles.analysis import CircleAnalysis, PairAnalysis


class Quantity(StrEnum):
    """What a budget is for."""

    G = "G"
    F = "F"
    RADIUS = "radius"
    X = "X"
    Y = "Y"
    G_BOTH = "G(b)"
    D = "D"
    H = "H"


class Cause(StrEnum):
    """Terms of a budget."""

    NOISE = "noise of the readings"
    RESOLUTION = "step of the readings"
    SAMPLING = "peaks between samples"
    CLOSURE = "drift over the turn"
    ANGLE = "where the turn begins"
    BAR = "calibrated length of the bar"
    TEMPERATURE = "temperature of the bar"
    MOUNTING = "where the ball stands"


NOT_STATED = (
    "form of both balls",
    "how fast the gauge follows",
    "heat of the machine between runs",
)
"""Causes that neither recording nor session can show; a bar's certificate or its maker can."""


@dataclass(frozen=True)
class SetUpKnowledge:
    """What the session states of bar and ball; None where it does not.

    Attributes:
        u_bar_um: standard uncertainty of the bar's calibrated length [µm].
        expansion_um_m_k: thermal expansion of the bar [µm/(m K)].
        calibrated_degc: temperature of the bar at its calibration [degC].
        measured_degc: temperature of the bar, or of the shop, at the measurement [degC].
        u_ball_um: standard uncertainty of the ball's place in X and in Y, coordinate and mounting together [µm].
        u_ball_z_um: the same for its height [µm].
    """

    u_bar_um: float | None = None
    expansion_um_m_k: float | None = None
    calibrated_degc: float | None = None
    measured_degc: float | None = None
    u_ball_um: float | None = None
    u_ball_z_um: float | None = None


@dataclass(frozen=True)
class Budget:
    """Standard uncertainty of one figure.

    Attributes:
        quantity: which.
        terms_um: standard uncertainty by cause [µm].
        missing: causes that count for it and that nobody stated.
        noise_adds_um: how much larger noise alone makes it, not taken off [µm].
    """

    quantity: Quantity
    terms_um: Mapping[Cause, float]
    missing: tuple[str, ...] = ()
    noise_adds_um: float = 0.0

    @property
    def u_um(self) -> float:
        """Root of the sum of squares of its terms [µm]."""
        return float(np.sqrt(sum(term**2 for term in self.terms_um.values())))


@dataclass
class _Draft:
    terms: dict[Cause, float] = field(default_factory=dict)
    missing: list[str] = field(default_factory=list)


def budgets(one: CircleAnalysis, known: SetUpKnowledge) -> dict[Quantity, Budget]:
    """Return the budgets of G, F about the centre, radius, X and Y of a circle.

    Args:
        one: the circle.
        known: what the session states.
    """
    along = one.raw.circle.bar_mm / one.raw.circle.radius_mm  # a raised bar: 1 / cos e
    count, sigma = len(one.raw), along * one.noise.sigma_um
    peak = _peak_noise_um(one)
    shape = {
        Cause.NOISE: peak,
        Cause.RESOLUTION: along * one.noise.resolution_um / ROUNDING,
        Cause.SAMPLING: _between_samples_um(one) / np.sqrt(3.0),
        Cause.CLOSURE: _closure_um(one) / ROUNDING,
    }
    length = _length_terms(one, known, along)
    adds = 2.0 * peak * _expected_extreme(one)
    ranges = {cause: size if cause is Cause.SAMPLING else np.sqrt(2.0) * size for cause, size in shape.items()}
    found = {
        Quantity.G: Budget(Quantity.G, ranges, NOT_STATED, adds),
        Quantity.F: Budget(Quantity.F, {**shape, **length.terms}, (*length.missing, *NOT_STATED), 0.5 * adds),
        Quantity.RADIUS: Budget(
            Quantity.RADIUS,
            {Cause.NOISE: sigma / np.sqrt(count), **length.terms},
            (*length.missing, *NOT_STATED),
        ),
    }
    across_um = 1e3 * np.array([one.centre_mm[1], one.centre_mm[0]])
    for quantity, off_um in zip((Quantity.X, Quantity.Y), across_um, strict=True):
        terms = {
            Cause.NOISE: sigma * np.sqrt(2.0 / count),
            Cause.ANGLE: abs(float(off_um)) * np.radians(one.raw.start_uncertainty_deg),
            # A drift c over the turn is a sawtooth, whose first harmonic is c / pi across the start.
            Cause.CLOSURE: _closure_um(one) / np.pi / np.sqrt(3.0),
        }
        missing = [*NOT_STATED]
        if known.u_ball_um is None:
            missing.insert(0, Cause.MOUNTING.value)
        else:
            terms[Cause.MOUNTING] = known.u_ball_um
        found[quantity] = Budget(quantity, terms, tuple(missing))
    return found


def pair_budgets(pair: PairAnalysis, known: SetUpKnowledge) -> dict[Quantity, Budget]:
    """Return the budgets of G(b), D and H of a circle in both directions on one mounting.

    Args:
        pair: the circle in both directions.
        known: what the session states; bar and ball are the same in both.
    """
    each = [budgets(one, known) for one in (pair.one, pair.other)]
    g, radius = [one[Quantity.G] for one in each], [one[Quantity.RADIUS] for one in each]
    turned = float(np.hypot(pair.one.raw.start_uncertainty_deg, pair.other.raw.start_uncertainty_deg))
    slope_um = _slope_um_per_deg(pair)
    both_g = {cause: float(np.sqrt(np.mean([b.terms_um[cause] ** 2 for b in g]))) for cause in g[0].terms_um}
    noise = float(np.hypot(radius[0].terms_um[Cause.NOISE], radius[1].terms_um[Cause.NOISE])) / 2.0
    shared: dict[Cause, float] = {cause: size for cause, size in radius[0].terms_um.items() if cause is not Cause.NOISE}
    adds = max(b.noise_adds_um for b in g)
    return {
        Quantity.G_BOTH: Budget(Quantity.G_BOTH, {**both_g, Cause.ANGLE: slope_um * turned}, g[0].missing, adds),
        Quantity.D: Budget(Quantity.D, {Cause.NOISE: noise, **shared}, radius[0].missing),
        Quantity.H: Budget(Quantity.H, {**both_g, Cause.ANGLE: slope_um * turned}, NOT_STATED, adds),
    }


def _length_terms(one: CircleAnalysis, known: SetUpKnowledge, along: float) -> _Draft:
    """What bar and height of the ball do to lengths in the plane of the circle."""
    draft = _Draft()
    if known.u_bar_um is None:
        draft.missing.append(Cause.BAR.value)
    else:
        draft.terms[Cause.BAR] = along * known.u_bar_um
    stated = (known.expansion_um_m_k, known.calibrated_degc, known.measured_degc)
    if any(value is None for value in stated):
        draft.missing.append(Cause.TEMPERATURE.value)
    else:
        expansion, calibrated, measured = (float(value) for value in stated if value is not None)
        # Nothing is added to readings: what the bar grew is left in them, and the whole of it may be.
        draft.terms[Cause.TEMPERATURE] = along * abs(expansion * (measured - calibrated)) * one.raw.circle.bar_mm / 1e3
    if one.raw.circle.elevation_deg:
        draft.missing.append("height of the tool tip above the ball")
        if known.u_ball_z_um is not None:
            rise = abs(float(np.tan(np.radians(one.raw.circle.elevation_deg))))
            draft.terms[Cause.MOUNTING] = rise * known.u_ball_z_um
    return draft


def _closure_um(one: CircleAnalysis) -> float:
    """Size of what drifted over the turn: by the overlap where there is one, else by the ends of the turn [µm]."""
    if one.passes is not None:
        return abs(one.passes.mean_um)
    return 0.0 if one.closure is None else abs(one.closure.height_um)


def _passing(one: CircleAnalysis) -> float:
    """Undulations per revolution that the figure's noise reaches to."""
    most = len(one.raw) / 2.0
    if not one.chosen:
        return most
    # Integral of the squared transmission 2^(-2 x²) over x from 0 to infinity.
    return min(most, float(one.chosen) * 0.5 * float(np.sqrt(np.pi / (2.0 * np.log(2.0)))))


def _peak_noise_um(one: CircleAnalysis) -> float:
    """Standard deviation of the noise of one point of the path, filtered [µm]."""
    along = one.raw.circle.bar_mm / one.raw.circle.radius_mm
    if not one.chosen:
        return along * float(np.nan_to_num(one.noise.reading_um))
    return along * one.noise.sigma_um * float(np.sqrt(2.0 * _passing(one) / len(one.raw)))


def _expected_extreme(one: CircleAnalysis) -> float:
    """Expected greatest of as many independent normal values as noise has over the turn, in standard deviations.

    sqrt(2 ln n), first order of the theory of extremes. It holds for a circle that is round beyond its noise; a form that
    stands out has few points near its peaks and gains less: an upper bound.
    """
    return float(np.sqrt(2.0 * np.log(max(2.0 * _passing(one), 2.0))))


def _between_samples_um(one: CircleAnalysis) -> float:
    """Height that a peak may have between two samples, of the form up to 50 undulations per revolution [µm]."""
    if one not in _BETWEEN:
        form = gaussian(one.path.theta_deg, 1e3 * one.path.least_squares.deviation_mm, _FORM_UPR)
        _BETWEEN[one] = float(np.abs(np.diff(form, 2)).max(initial=0.0)) / 8.0
    return _BETWEEN[one]


_BETWEEN: WeakKeyDictionary[CircleAnalysis, float] = WeakKeyDictionary()
"""Such heights, which the budgets of a circle, of its pair and of a tolerance ask for."""


_FORM_UPR = 50.0
"""Undulations per revolution up to which form counts between samples: what is shorter is noise, and has its own term."""


def _slope_um_per_deg(pair: PairAnalysis) -> float:
    """Root-mean-square slope of the paths along the turn, centre and undulations together [µm/deg]."""
    squares = [
        (1e3 * float(np.hypot(*one.centre_mm))) ** 2 + sum((h.undulations * h.amplitude_um) ** 2 for h in one.harmonics)
        for one in (pair.one, pair.other)
    ]
    return float(np.radians(np.sqrt(np.mean(squares) / 2.0)))
