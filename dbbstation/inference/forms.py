"""Curves of unmodelled effects over variables, with few amplitudes; splines, and inaccurate formulas.

A form computes its columns and chooses the points to print. Smooth modulations represent the inaccuracy of a formula
[Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001) 425, sec. 4, on model discrepancy].
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import BSpline
from scipy.special import comb

from dbbstation.inference.bounds import BOUNDS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.computing.arrays import Flags, Floats


SPLINES = 7
"""Points of a piecewise linear curve."""


HARMONICS = (2, 3, 5, 8)
"""Tried numbers of harmonics of a periodic effect: its shape is seldom a sine and is unknown."""


class Form(ABC):
    """A family of curves with p amplitudes."""

    @property
    def count(self) -> int:
        """Return the number of amplitudes; by default one."""
        return 1

    @abstractmethod
    def columns(self, values: Floats) -> Floats:
        """Return each amplitude's curve at values, shape (..., p)."""

    def points(self, low: float, high: float, /) -> Floats:
        """Return points to print within the range, shape (q,); by default three, enough for a straight line."""
        return np.linspace(low, high, 3)

    def text(self, _unit: str, /) -> str:
        """Return what distinguishes this form, in the variable's unit; may be empty."""
        return ""


@dataclass(frozen=True, eq=False)
class LinearSplines(Form):
    """A piecewise linear curve with seven points; limits may be arrays by strut."""

    low: Floats
    high: Floats

    count = SPLINES

    def columns(self, values: Floats) -> Floats:
        place = (values - self.low) / np.maximum(self.high - self.low, 1e-12) * (SPLINES - 1)
        return np.maximum(0.0, 1.0 - np.abs(place[..., None] - np.arange(SPLINES)))

    def points(self, _low: float, _high: float, /) -> Floats:
        return np.linspace(np.mean(self.low), np.mean(self.high), SPLINES)


@dataclass(frozen=True, eq=False)
class Walk(Form):
    """A random walk with step variances proportional to their length.

    Args:
        at: ascending places, shape (p + 1,).
        unit: length of a unit step, in the variable's unit.
    """

    at: Floats
    unit: float

    @property
    def count(self) -> int:
        return len(self.at) - 1

    def columns(self, values: Floats) -> Floats:
        steps = np.diff(self.at)
        return np.clip((values[..., None] - self.at[:-1]) / steps, 0.0, 1.0) * np.sqrt(steps / self.unit)

    def points(self, _low: float, _high: float, /) -> Floats:
        return self.at


@dataclass(frozen=True, eq=False)
class Wave(Form):
    """Cosine and sine of a frequency [1 / unit], and of its multiples."""

    frequency: float
    harmonics: int = 1

    @property
    def count(self) -> int:
        return 2 * self.harmonics

    def text(self, unit: str, /) -> str:
        more = f" and {self.harmonics - 1} harmonics" if self.harmonics > 1 else ""
        return f"period {1.0 / self.frequency:.6g} {unit}{more}"

    def columns(self, values: Floats) -> Floats:
        phase = 2.0 * np.pi * self.frequency * np.asarray(values)
        return np.stack([f(k * phase) for k in range(1, self.harmonics + 1) for f in (np.cos, np.sin)], axis=-1)

    def points(self, low: float, high: float, /) -> Floats:
        periods = (high - low) * self.frequency
        periods = periods if periods <= BOUNDS.periods_shown else 1.0
        span = periods / self.frequency
        return np.linspace(low, low + span, max(2, int(np.ceil(periods * self.harmonics * BOUNDS.points_per_wave)) + 1))


@dataclass(frozen=True, eq=False)
class WaveOfTurn(Form):
    """A wave of the angle since the start [turns], with separate phases for both directions.

    The variable is positive counterclockwise.
    """

    frequency: float

    count = 4

    def text(self, _unit: str, /) -> str:
        return f"{self.frequency:.4g} per turn"

    def columns(self, values: Floats) -> Floats:
        both = Wave(self.frequency).columns(np.abs(values))
        ccw = (values > 0.0)[..., None]
        return np.concatenate([both * ccw, both * ~ccw], axis=-1)

    def points(self, _low: float, _high: float, /) -> Floats:
        turn = np.linspace(0.0, 1.0, int(np.ceil(BOUNDS.points_per_wave * max(self.frequency, 1.0))) + 1)
        return np.concatenate([-turn[:0:-1], turn[1:]])


@dataclass(frozen=True, eq=False)
class Lobes(Form):
    """Waves that close within a turn [deg]."""

    numbers: tuple[int, ...]

    @property
    def count(self) -> int:
        return 2 * len(self.numbers)

    def text(self, _unit: str, /) -> str:
        return f"{self.numbers[0]} lobes" if len(self.numbers) == 1 else ""

    def columns(self, values: Floats) -> Floats:
        theta = np.radians(values)
        return np.stack([f(k * theta) for k in self.numbers for f in (np.cos, np.sin)], axis=-1)

    def points(self, _low: float, _high: float, /) -> Floats:
        step = 10.0 if max(self.numbers) <= 10 else 5.0  # noqa: PLR2004 - lobes as in `LOBES`
        return np.arange(0.0, 360.0, step)


@dataclass(frozen=True, eq=False)
class Bump(Form):
    """A bell with a standard deviation as width."""

    centre: float
    width: float

    def text(self, unit: str, /) -> str:
        return f"about {self.centre:.5g} {unit}, {self.width:.3g} {unit} wide either way"

    def columns(self, values: Floats) -> Floats:
        return np.exp(-0.5 * ((values - self.centre) / self.width) ** 2)[..., None]

    def points(self, low: float, high: float, /) -> Floats:
        return _across(self.centre, self.width, low, high)


@dataclass(frozen=True, eq=False)
class StepForm(Form):
    """A smooth step from minus to plus a half."""

    at: float
    width: float

    def text(self, unit: str, /) -> str:
        return f"at {self.at:.5g} {unit}"

    def columns(self, values: Floats) -> Floats:
        return 0.5 * np.tanh((values - self.at) / self.width)[..., None]

    def points(self, low: float, high: float, /) -> Floats:
        return _across(self.at, self.width, low, high)


def _across(at: float, width: float, low: float, high: float) -> Floats:
    reach = BOUNDS.tails_shown
    near = at + width * np.linspace(-reach, reach, int(2 * reach * BOUNDS.points_per_width) + 1)
    return np.unique(np.concatenate([[low], near[(near > low) & (near < high)], [high]]))


@dataclass(frozen=True, eq=False)
class SignForm(Form):
    """Plus one in one direction, minus one in the other."""

    def columns(self, values: Floats) -> Floats:
        return np.sign(values)[..., None]

    def points(self, _low: float, _high: float, /) -> Floats:
        return np.array([-1.0, 1.0])


@dataclass(frozen=True, eq=False)
class Proportional(Form):
    """Proportional to the variable less `about`; amplitude per `unit`."""

    unit: float
    about: float = 0.0

    def columns(self, values: Floats) -> Floats:
        return ((values - self.about) / self.unit)[..., None]


@dataclass(frozen=True, eq=False)
class Plane(Form):
    """Proportional to coordinates; `constant` adds a constant."""

    unit: float
    coordinates: int
    constant: bool = False

    @property
    def count(self) -> int:
        return self.coordinates + self.constant

    def text(self, _unit: str, /) -> str:
        return "with a constant" if self.constant else ""

    def columns(self, values: Floats) -> Floats:
        """Return coordinates in their unit; values of shape (n, c)."""
        scaled = values / self.unit
        return np.column_stack([scaled, np.ones(len(scaled))]) if self.constant else scaled


@dataclass(frozen=True, eq=False)
class PlaneStep(Form):
    """A step across a straight line in the plane, by angle to +X and distance."""

    across_deg: float
    at: float
    width: float

    def text(self, unit: str, /) -> str:
        return f"across a line {self.at:.4g} {unit} from the origin, at {self.across_deg:.0f} deg to +X"

    @property
    def across(self) -> Floats:
        """Return the direction across the line, shape (2,)."""
        return np.array([np.cos(np.radians(self.across_deg)), np.sin(np.radians(self.across_deg))])

    def along(self, values: Floats) -> Floats:
        """Return the coordinate perpendicular to the line, shape (n,)."""
        return values @ self.across

    def columns(self, values: Floats) -> Floats:
        """Return the step from minus to plus a half, at values of shape (n, 2)."""
        return StepForm(self.at, self.width).columns(self.along(values))

    def points(self, low: float, high: float, /) -> Floats:
        return _across(self.at, self.width, low, high)


@dataclass(frozen=True, eq=False)
class Spring(Form):
    """Constant plus proportional to a distance: a spring of unknown length.

    Args:
        towards_deg: direction to its far end, seen from Z.
        about: zero distance [mm].
    """

    towards_deg: float
    about: float

    count = 2

    def text(self, _unit: str, /) -> str:
        return f"towards {self.towards_deg:.0f} deg to +X"

    def columns(self, values: Floats) -> Floats:
        """Return one, and the distance in 100 mm; values of shape (n,)."""
        return np.column_stack([np.ones(len(values)), (values - self.about) / 100.0])


@dataclass(frozen=True, eq=False)
class Ringing(Form):
    """A damped oscillation over the signed time since a reversal: cosine and sine."""

    period: float
    decay: float

    count = 2

    def text(self, unit: str, /) -> str:
        return f"period {self.period:.3g} {unit}, fading over {self.decay:.3g} {unit}"

    def columns(self, values: Floats) -> Floats:
        since = np.abs(values)
        phase = 2.0 * np.pi * since / self.period
        fading = -np.sign(values) * np.exp(-since / self.decay)
        return np.stack([fading * np.cos(phase), fading * np.sin(phase)], axis=-1)

    def points(self, _low: float, high: float, /) -> Floats:
        last = min(high, BOUNDS.tails_shown * self.decay)
        return np.linspace(1e-6, last, max(int(BOUNDS.points_per_wave * last / self.period), 2) + 1)


@dataclass(frozen=True, eq=False)
class BehindReversal(Form):
    """The lag after a reversal: any curve of the distance since then, signed by the new direction.

    The curve is piecewise linear, zero at the reversal and beyond `length`. Each point is at half the distance of the
    next, because the curve bends most at its beginning.
    """

    length: float
    halves: int

    @property
    def count(self) -> int:
        return self.halves

    def text(self, unit: str, /) -> str:
        return f"over {self.length:.3g} {unit}"

    def columns(self, values: Floats) -> Floats:
        places = self.points(0.0, self.length)
        hats = [np.interp(np.abs(values), places, row) for row in np.eye(len(places))[1:-1]]
        return -np.sign(values)[..., None] * np.stack(hats, axis=-1)

    def points(self, _low: float, _high: float, /) -> Floats:
        return self.length * np.append(0.0, 0.5 ** np.arange(self.halves, -1, -1))


@dataclass(frozen=True, eq=False)
class Spline(Form):
    """A smooth curve: cubic B-splines over a range, constant outside.

    The splines sum to one [de Boor, A Practical Guide to Splines, rev. ed., ch. IX, eq. 36]. With `falls` the last is
    omitted, so the curve falls to zero.
    """

    low: float
    high: float
    functions: int = 7
    falls: bool = False

    @property
    def count(self) -> int:
        return self.functions - self.falls

    def columns(self, values: Floats) -> Floats:
        """Return B-splines at values, shape (..., p)."""
        inner = np.linspace(0.0, 1.0, self.functions - DEGREE + 1)
        knots = np.concatenate([np.zeros(DEGREE), inner, np.ones(DEGREE)])
        share = np.clip((np.asarray(values, dtype=np.float64) - self.low) / (self.high - self.low), 0.0, 1.0)
        flat = BSpline.design_matrix(share.ravel(), knots, DEGREE).toarray()
        return flat.reshape(*share.shape, self.functions)[..., : self.count]


@dataclass(frozen=True, eq=False)
class Clock:
    """Times of rows, and the response of rows to a step.

    Attributes:
        rows: time in row intervals, ascending, shape (n,); omitted rows count.
        response: response to a unit step over rows since the step, from 0 to 1.
        reach: rows until the response is constant.
    """

    rows: Floats
    response: Callable[[Floats], Floats]
    reach: float

    @classmethod
    def plain(cls, count: int) -> Clock:
        """Return the clock of gapless rows with immediate response."""
        return cls(np.arange(count, dtype=np.float64), lambda since: (since >= 0.0).astype(np.float64), 0.0)


@dataclass(frozen=True, eq=False)
class Stretches(Form):
    """One value per stretch of time, zero outside; the variable is a clock's rows.

    Attributes:
        last: infinite if endless.
    """

    first: tuple[float, ...]
    last: tuple[float, ...]
    response: Callable[[Floats], Floats]

    @property
    def count(self) -> int:
        return len(self.first)

    def columns(self, values: Floats) -> Floats:
        """Return each stretch's curve at values, shape (n, p)."""
        begun, ended = (self.response(values[..., None] - np.array(edges)) for edges in (self.first, self.last))
        return begun - ended


DEGREE = 3
"""Degree of splines, and of modulating polynomials: four functions over the range of a variable."""

ALONG_SCREWS = 8
"""Their degree for friction and wear of screws, which vary over some tens of millimetres: nine functions over the range.
Of spikes of 1.9 µm rms that vary in waves of 98 to 235 mm, degree 3 leaves 0.28 µm, 5 0.23, 8 0.16 and 12 0.13."""

LATER = 2.0
"""Possible delay of a transit after a reversal, in samples: a degree of the turn."""


def bernstein(values: Floats, low: float, high: float, degree: int = DEGREE) -> Floats:
    """Return Bernstein polynomials over a range, shape (..., degree + 1), summing to one [Farin, Curves and Surfaces for CAGD, 5th ed., eq 5.1]."""
    share = np.clip((values - low) / max(high - low, 1e-12), 0.0, 1.0)[..., None]
    k = np.arange(degree + 1)
    return comb(degree, k) * share**k * (1.0 - share) ** (degree - k)


def modulated(
    effects: Sequence[Floats],
    along: Sequence[Floats],
    signs: Sequence[Floats] | None,
    degree: int = DEGREE,
    *,
    each_side: bool = False,
) -> Floats:
    """Return effects of m actuators times smooth functions, over all runs, shape (n, q).

    Args:
        signs: directions of travel per run, shape (n, m); None if irrelevant.
        each_side: functions differ on both sides of zero.
    """
    effect, values = np.vstack(effects), np.vstack(along)
    ways = [np.ones_like(effect)] if signs is None else [np.vstack(signs) > 0.0, np.vstack(signs) <= 0.0]
    found = []
    for mover in range(effect.shape[1]):
        own, at = effect[:, mover], values[:, mover]
        if not own.any():
            continue
        sides = [at > 0.0, at <= 0.0] if each_side else [np.ones_like(at, dtype=bool)]
        functions = np.hstack([_within(at, side, degree) for side in sides if side.any()])
        found += [functions * (own * way[:, mover])[:, None] for way in ways]
        if signs is not None:
            found.append(_other_transits(effects, signs, mover))
    return np.hstack(found) if found else np.zeros((len(effect), 0))


def _within(values: Floats, side: Flags, degree: int) -> Floats:
    """Return Bernstein polynomials over some of the values, zero at the others, shape (n, degree + 1)."""
    low, high = float(values[side].min()), float(values[side].max())
    return bernstein(values, low, high, degree) * side[:, None]


def _other_transits(effects: Sequence[Floats], signs: Sequence[Floats], mover: int) -> Floats:
    """Return two changes of one effect, for an instantaneous and for a delayed transition after reversals, shape (n, 2)."""
    found = []
    for effect, sign in zip(effects, signs, strict=True):
        own, way = effect[:, mover], np.sign(sign[:, mover])
        level = float(own @ way) / max(float(way @ way), 1.0)
        found.append(np.column_stack([level * way, np.gradient(own) * LATER]))
    return np.vstack(found)
