"""The curve of an error without a name: its values along the variable that organises it, with their uncertainty.

Amplitudes are those of the race, with the kinematic parameters, mountings, balls and bar fitted anew beside them. What
these can make of a curve cannot be told from them, so it is taken out by convention: a constant of everything, which is
a strut's reference length or the bar's offset, and of a curve over strut length also a slope, which joints can do almost
whole. What is printed is the curve less the straight line (or constant) that fits it best over all readings.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.findings import Curve, CurvePoint
from dbbstation.diagnosis.shapes import HATS, LOBES, hats, variables
from dbbstation.inference.concealment import concealment
from dbbstation.inference.race import free_directions

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.diagnosis.channel import Channel
    from dbbstation.inference.race import Amplitudes, Race, Variant

UNITS = {
    "strut-length": "mm",
    "strut-length wave": "mm",
    "strut-force": "N",
    "strut-speed-sign": "sign",
    "time": "s",
    "time of the reading": "s",
    "angle": "deg",
}
"""Of what the curve is a function of."""

TAKEN_OUT = {
    "strut-length": "less the straight line that fits it best over the readings: joints and reference length make that",
    "strut-force": "less its mean over the readings: the reference length makes that",
    "time": "less its mean over the readings: the reference length makes that",
    "time of the reading": "less its mean over the readings: the bar's offset makes that",
}
"""What is conventional of a curve and taken out of it; nothing of the others."""

SIZES = 2.0 ** np.arange(8)
"""Sizes that curves are tried with, as multiples of the usual one: a large error must not be drawn towards zero."""

POINTS_PER_WAVE = 8
ANGLES_DEG = np.arange(0.0, 360.0, 10.0)


def curve_of(channel: Channel, race: Race, name: str, variant: Variant) -> Curve | None:
    """Return the curve that an unnamed candidate found; None for one that is a plane, not a curve.

    Args:
        channel: that the race was run on.
        race: on that channel.
        name: of the candidate, `variable | strut`.
        variant: its best form.
    """
    variable, _, strut = name.partition(" | ")
    if variable not in UNITS:
        return None
    number = int(strut) if strut else None
    sized = max((replace(variant, prior=size * variant.prior) for size in SIZES), key=lambda one: race.evidence([one]))
    found = race.amplitudes([sized])
    at, values, covariance = _at_points(channel, variable, number, variant, found)
    covariance = covariance + np.eye(len(at)) * _not_followed(channel, race, variant) * np.mean(values**2)
    machine = np.flatnonzero(~channel.base.random)
    free = free_directions(channel.base, machine, channel.held)
    amplitudes = found.values
    if variable in TAKEN_OUT:
        amplitudes = values  # hats: a value at a point is the amplitude of its hat
    signature = concealment([channel.joined], machine, variant.columns, amplitudes, free)
    return Curve(
        variable=variable,
        unit=UNITS[variable],
        strut=number,
        period_mm=1.0 / variant.shape[0] if variant.shape else None,
        convention=TAKEN_OUT.get(variable, ""),
        readings_um=1e3 * signature.whole_rms,
        unconcealed_um=1e3 * signature.rest_rms,
        points=tuple(
            CurvePoint(float(x), 1e3 * float(value), 1e3 * float(np.sqrt(max(variance, 0.0))))
            for x, value, variance in zip(at, values, np.diag(covariance), strict=True)
        ),
    )


def _not_followed(channel: Channel, race: Race, variant: Variant) -> float:
    """Structured sum of squares that the curve leaves to all other curves together, over what it explains itself.

    A curve with a kink between two points, or another error beside this one, spoils the values more than noise does:
    each point is then uncertain by that share of the curve's own size.
    """
    every = [other for candidate in channel.unnamed for other in candidate.variants]
    own = race.explained([variant])
    more = race.explained(every) - sum(len(other.columns) for other in every) - own
    return max(more, 0.0) / max(own, 1e-300)


def _at_points(
    channel: Channel, variable: str, strut: int | None, variant: Variant, found: Amplitudes
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Places, values [mm] and covariance [mm²] of the points of a curve."""
    if variable == "angle":
        theta = np.radians(ANGLES_DEG)
        shape = np.column_stack([f(k * theta) for k in LOBES for f in (np.cos, np.sin)])
        return ANGLES_DEG, shape @ found.values, shape @ found.covariance @ shape.T
    if variable == "strut-speed-sign":
        signs = np.array([-1.0, 1.0])
        return signs, signs * found.values[0], np.outer(signs, signs) * found.covariance[0, 0]
    if variable == "strut-length wave":
        return _wave(channel, strut or 1, variant.shape[0], found)
    of = variable.removesuffix(" of the reading")
    extent = channel.extent
    struts = np.arange(len(extent.low[of])) if strut is None else np.array([strut - 1])
    at = np.linspace(extent.low[of][struts].mean(), extent.high[of][struts].mean(), HATS)
    order = 1 if variable == "strut-length" else 0
    keep = np.eye(HATS) - _line(np.linspace(-1.0, 1.0, HATS), _weights(channel, of, struts), order)
    return at, keep @ found.values, keep @ found.covariance @ keep.T


def _line(at: NDArray[np.float64], weights: NDArray[np.float64], order: int) -> NDArray[np.float64]:
    """Matrix from values at points to those of the polynomial of an order that fits them best, shape (p, p)."""
    basis = np.vander(at, order + 1)
    weighted = basis.T * weights
    return np.asarray(basis @ np.linalg.solve(weighted @ basis, weighted), dtype=np.float64)


def _weights(channel: Channel, variable: str, struts: NDArray[np.int64]) -> NDArray[np.float64]:
    """How many readings lie about each point of a piecewise linear curve, shape (7,)."""
    total = np.zeros(HATS)
    for observation in channel.observations:
        motion = observation.motion()
        values = variables(motion, channel.machine)[variable][motion.kept]
        near = hats(values, channel.extent.low[variable], channel.extent.high[variable])
        total += near[:, struts].sum(axis=(0, 1))
    return total


def _wave(
    channel: Channel, strut: int, wave: float, found: Amplitudes
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Points of a wave over the strut lengths that were travelled, its period taken for known."""
    lengths = np.concatenate(
        [
            variables(motion, channel.machine)["strut-length"][motion.kept, strut - 1]
            for motion in (observation.motion() for observation in channel.observations)
        ]
    )
    low, high = lengths.min(), lengths.max()
    at = np.linspace(low, high, max(2, int(np.ceil((high - low) * wave * POINTS_PER_WAVE)) + 1))
    angle = 2.0 * np.pi * wave * at
    shape = np.column_stack([np.cos(angle), np.sin(angle)])
    return at, shape @ found.values, shape @ found.covariance @ shape.T
