"""Uncertainty budgets of circle figures; they name causes of unstated size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from math import sqrt
from typing import TYPE_CHECKING, Annotated

import numpy as np

from dbbstation.circles.estimates import ABSOLUTE, FIRST, BudgetQuantity, estimate_of, pair_estimate, slow_noise_um
from dbbstation.circles.noise import FEWEST_SAMPLES, ROUNDING
from dbbstation.computing.arrays import hypot_of
from dbbstation.computing.threads import with_one_thread
from dbbstation.facts.serialise import Kept, OrNull
from dbbstation.inference.harmonics import SAMPLES_PER_HARMONIC, coefficients

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dbbstation.circles.analysis import CircleAnalysis, PairAnalysis
    from dbbstation.computing.arrays import Floats, Integers


class BudgetTerm(StrEnum):
    """Terms of a budget."""

    NOISE = "noise of the readings"
    RESOLUTION = "step of the readings"
    CLOSURE = "drift over the turn"
    ANGLE = "where the turn begins"
    BAR = "calibrated length of the bar"
    TEMPERATURE = "temperature of the bar"
    MOUNTING = "place of the ball"
    FORM = "form of both balls"


NOT_STATED: tuple[str, ...] = (
    BudgetTerm.FORM.value,
    "how fast the gauge follows",
    "heat of the machine between runs",
)
"""Causes that neither recording nor session shows, only the bar's certificate or maker."""


@dataclass(frozen=True)
class SetUpKnowledge:
    """Stated uncertainties of bar and ball; None if not stated.

    Attributes:
        u_temperature_um: standard uncertainty of corrected growth.
        u_ball_um: standard uncertainty of a ball's X and Y, due to coordinate and mounting.
        u_form_um: standard uncertainty of a reading due to the form of both balls.
    """

    u_bar_um: float | None = None
    u_temperature_um: float | None = None
    not_absolute: str = ""
    u_ball_um: float | None = None
    u_ball_z_um: float | None = None
    u_form_um: float | None = None


@dataclass(frozen=True)
class Budget:
    """Standard uncertainty of one figure.

    Attributes:
        u_um: standard uncertainty; None if a contribution is unknown.
        value_um: figure without the contribution of noise.
    """

    u_um: float | None
    terms_um: Mapping[BudgetTerm, float]
    missing: tuple[str, ...]
    why_not: OrNull
    value_um: float
    as_read_um: float
    quantity: Annotated[BudgetQuantity, Kept]

    @property
    def known_um(self) -> float:
        """Return the root sum of squares of known terms [µm]."""
        return sqrt(sum(term**2 for term in self.terms_um.values()))


def _budget(
    quantity: BudgetQuantity,
    terms_um: Mapping[BudgetTerm, float],
    missing: tuple[str, ...],
    value_um: float,
    as_read_um: float,
    why_not: str = "",
) -> Budget:
    found = Budget(None, terms_um, missing, why_not, value_um, as_read_um, quantity)
    return found if why_not else replace(found, u_um=found.known_um)


TOO_FEW = f"fewer than {FEWEST_SAMPLES} samples do not separate noise from form"
"""Why a figure of few samples has no uncertainty."""

NO_PLACE = "not absolute, because the ball's place is unknown"
"""Why the centre about a ball set up under the spindle has no uncertainty."""

NO_HEIGHT = "not absolute, because a raised bar does not tell the radius from the height of the tool tip"
"""Why the radius of a raised bar has no uncertainty: a tool tip higher by dz lengthens it by dz tan e."""

RANGES = (BudgetQuantity.G, BudgetQuantity.G_LS, BudgetQuantity.F_MAX, BudgetQuantity.F_MIN)
"""Figures that are extremes of one circle's path."""


def budget_of(one: CircleAnalysis, quantity: BudgetQuantity, known: SetUpKnowledge) -> Budget:
    """Return the budget of a figure of one circle."""
    if quantity in RANGES:
        return _range(one, quantity, known)
    along = one.raw.circle.bar_mm / one.raw.circle.radius_mm  # a raised bar: 1 / cos e
    if quantity in ABSOLUTE:
        # The mean of readings is along the bar, the radius in the plane of the circle.
        scale = 1.0 if quantity is BudgetQuantity.MEAN_RADIAL else along
        value = one.mean_radial_error_um if quantity is BudgetQuantity.MEAN_RADIAL else one.radius_error_um
        terms, lacking = _length_terms(one, known, scale)
        return _budget(quantity, terms, (*lacking, *NOT_STATED), value, value, _why_not(one, quantity, known))
    axis = 0 if quantity is BudgetQuantity.X else 1
    across_um = 1e3 * one.centre_mm[1 - axis]
    value = 1e3 * one.centre_mm[axis]
    terms = {
        BudgetTerm.NOISE: along * slow_noise_um(one, 1) * np.sqrt(2.0 / len(one.raw)),
        BudgetTerm.ANGLE: abs(across_um) * np.radians(one.raw.start_uncertainty_deg),
        # A drift c over the turn is a sawtooth; its first harmonic is c / pi, perpendicular to the start.
        BudgetTerm.CLOSURE: _closure_um(one) / np.pi / np.sqrt(3.0),
    }
    missing = [*NOT_STATED]
    if known.u_ball_um is None:
        missing.insert(0, BudgetTerm.MOUNTING.value)
    else:
        terms[BudgetTerm.MOUNTING] = known.u_ball_um
    return _budget(quantity, terms, tuple(missing), value, value, _why_not(one, quantity, known))


def _why_not(one: CircleAnalysis, quantity: BudgetQuantity, known: SetUpKnowledge) -> str:
    reasons = []
    if quantity in ABSOLUTE:
        reasons.append(known.not_absolute)
        if one.raw.circle.elevation_deg and quantity is not BudgetQuantity.MEAN_RADIAL:
            reasons.append(NO_HEIGHT)
    if quantity in {BudgetQuantity.X, BudgetQuantity.Y} and known.u_ball_um is None:
        reasons.append(NO_PLACE)
    if not one.noise.known:
        reasons.append(TOO_FEW)
    return "; ".join(filter(None, reasons))


def _range(one: CircleAnalysis, quantity: BudgetQuantity, known: SetUpKnowledge) -> Budget:
    along = one.raw.circle.bar_mm / one.raw.circle.radius_mm
    terms = _of_extremes(one, 1 if quantity in ABSOLUTE else 2)
    missing = NOT_STATED
    if quantity in ABSOLUTE:
        length, lacking = _length_terms(one, known, along)
        terms |= length
        missing = (*lacking, *NOT_STATED)
    why = _why_not(one, quantity, known)
    found = estimate_of(one, quantity)
    if found is None:
        read = {
            BudgetQuantity.G: one.g_um,
            BudgetQuantity.G_LS: one.g_least_squares_um,
            BudgetQuantity.F_MAX: one.f_centred.largest_um,
            BudgetQuantity.F_MIN: one.f_centred.least_um,
        }[quantity]
        return _budget(quantity, terms, missing, read, read, why)
    terms[BudgetTerm.NOISE] = hypot_of(found.u_um, terms.get(BudgetTerm.NOISE, 0.0))
    return _budget(quantity, terms, missing, found.value_um, found.as_read_um, why)


def _of_extremes(one: CircleAnalysis, extremes: int) -> dict[BudgetTerm, float]:
    along = one.raw.circle.bar_mm / one.raw.circle.radius_mm
    root = sqrt(extremes)
    return {
        BudgetTerm.RESOLUTION: root * along * one.noise.resolution_um / ROUNDING,
        BudgetTerm.CLOSURE: root * _closure_um(one) / ROUNDING,
    }


OF_ONE = (*RANGES, BudgetQuantity.RADIUS, BudgetQuantity.MEAN_RADIAL, BudgetQuantity.X, BudgetQuantity.Y)
OF_BOTH = (BudgetQuantity.G_BOTH, BudgetQuantity.G_BOTH_LS, BudgetQuantity.D, BudgetQuantity.H)


@with_one_thread
def budgets(
    one: CircleAnalysis, known: SetUpKnowledge, quantities: Iterable[BudgetQuantity] = OF_ONE
) -> dict[BudgetQuantity, Budget]:
    """Return budgets of figures; arguments as of `budget_of`."""
    return {quantity: _with_form(budget_of(one, quantity, known), known) for quantity in quantities}


def _with_form(budget: Budget, known: SetUpKnowledge) -> Budget:
    """Return a budget with the form of both balls, if stated."""
    # A range of readings errs by at most the form of either ball. Hysteresis compares the same places of both.
    if known.u_form_um is None:
        return budget
    terms = dict(budget.terms_um)
    if budget.quantity is not BudgetQuantity.H:
        terms[BudgetTerm.FORM] = known.u_form_um
    missing = tuple(cause for cause in budget.missing if cause != BudgetTerm.FORM)
    return _budget(budget.quantity, terms, missing, budget.value_um, budget.as_read_um, budget.why_not)


@with_one_thread
def pair_budgets(pair: PairAnalysis, known: SetUpKnowledge) -> dict[BudgetQuantity, Budget]:
    """Return the budgets of G(b), D and H of a circle in both directions on one mounting."""
    radius = [budget_of(one, BudgetQuantity.RADIUS, known) for one in (pair.one, pair.other)]
    noise = hypot_of(radius[0].terms_um[BudgetTerm.NOISE], radius[1].terms_um[BudgetTerm.NOISE]) / 2.0
    d_terms = {**radius[0].terms_um, BudgetTerm.NOISE: noise}
    found = {
        quantity: _pair_range(pair, quantity)
        for quantity in (BudgetQuantity.G_BOTH, BudgetQuantity.G_BOTH_LS, BudgetQuantity.H)
    }
    why = next((each.why_not for each in radius if each.why_not), "")
    found[BudgetQuantity.D] = _budget(BudgetQuantity.D, d_terms, radius[0].missing, pair.d_um, pair.d_um, why)
    return {quantity: _with_form(found[quantity], known) for quantity in OF_BOTH}


def _pair_range(pair: PairAnalysis, quantity: BudgetQuantity) -> Budget:
    each = [_of_extremes(one, 2) for one in (pair.one, pair.other)]
    turned = hypot_of(pair.one.raw.start_uncertainty_deg, pair.other.raw.start_uncertainty_deg)
    terms = {
        cause: sqrt(np.mean([terms[cause] ** 2 for terms in each]))
        for cause in (BudgetTerm.RESOLUTION, BudgetTerm.CLOSURE)
    }
    terms[BudgetTerm.ANGLE] = _slope_um_per_deg(pair) * turned
    read = {
        BudgetQuantity.G_BOTH: pair.g_um,
        BudgetQuantity.G_BOTH_LS: pair.g_least_squares_um,
        BudgetQuantity.H: pair.h_um,
    }[quantity]
    found = pair_estimate(pair, quantity)
    if found is None:
        return _budget(quantity, terms, NOT_STATED, read, read, TOO_FEW)
    terms[BudgetTerm.NOISE] = found.u_um
    return _budget(quantity, terms, NOT_STATED, found.value_um, read)


def _length_terms(
    one: CircleAnalysis, known: SetUpKnowledge, scale: float
) -> tuple[dict[BudgetTerm, float], list[str]]:
    terms = {BudgetTerm.NOISE: scale * slow_noise_um(one, 0) / float(np.sqrt(len(one.raw)))}
    missing = list[str]()
    for cause, size in ((BudgetTerm.BAR, known.u_bar_um), (BudgetTerm.TEMPERATURE, known.u_temperature_um)):
        if size is None:
            missing.append(cause.value)
        else:
            terms[cause] = scale * size
    if one.raw.circle.elevation_deg:
        missing.append("height of the tool tip above the ball")
        if known.u_ball_z_um is not None:
            rise = abs(float(np.tan(np.radians(one.raw.circle.elevation_deg))))
            terms[BudgetTerm.MOUNTING] = rise * known.u_ball_z_um
    return terms, missing


def _closure_um(one: CircleAnalysis) -> float:
    if one.passes is not None:
        drift, u = one.passes.mean_um, one.passes.u_mean_um(one.noise.sigma_um)
    elif one.closure is not None:
        drift, u = one.closure.height_um, one.closure.u_um
    else:
        return 0.0
    return sqrt(max(drift**2 - u**2, 0.0))


def _slope_um_per_deg(pair: PairAnalysis) -> float:
    squares = [
        (1e3 * hypot_of(*one.centre_mm)) ** 2 + sum((h.undulations * h.amplitude_um) ** 2 for h in one.harmonics)
        for one in (pair.one, pair.other)
    ]
    return float(np.radians(np.sqrt(np.mean(squares) / 2.0)))


HIGHEST = 60
"""Highest undulations per revolution with an amplitude, twice as many as usual in a machine's form."""


@dataclass(frozen=True, eq=False)
class FormSpectrum:
    """Unfiltered amplitudes about the least-squares circle.

    Attributes:
        amplitude_um: half of peak to valley, shape (h,).
        noise_um: rms amplitude of noise; NaN if unknown.
    """

    undulations: Integers
    amplitude_um: Floats
    noise_um: float


def spectrum_of(one: CircleAnalysis) -> FormSpectrum:
    """Return a circle's undulations.

    White noise s per sample has the rms amplitude 2 s / sqrt(n), from two coefficients.
    """
    count = len(one.raw)
    highest = min(HIGHEST, count // SAMPLES_PER_HARMONIC)
    if highest < FIRST:
        return FormSpectrum(np.arange(0), np.zeros(0), float("nan"))
    found = coefficients(one.residual_um, np.radians(one.raw.theta_deg), highest)
    amplitude = np.sqrt(2.0 / count) * np.hypot(found[1 : highest + 1], found[highest + 1 :])
    noise_um = 2.0 * one.noise.slow_um / sqrt(count)
    return FormSpectrum(np.arange(FIRST, highest + 1), amplitude[FIRST - 1 :], noise_um)
