"""Search a residual for waves, bumps, steps and pulses, and find its significant features beside base and members.

Sums over bins of a variable give the squares that curves explain, quickly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.chebyshev import chebpts1, chebvander
from scipy.fft import rfft
from scipy.sparse import csr_array

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.channel import Kind, Variable
from dbbstation.inference.coloured import Left
from dbbstation.inference.forms import HARMONICS, Bump, Form, Spline, StepForm, Wave
from dbbstation.inference.patterns import CURVES, Family, Pattern, log_odds
from dbbstation.inference.square_root import free_directions
from dbbstation.inference.stretches import refined, stretches
from dbbstation.inference.triangle import products_of_rows

if TYPE_CHECKING:
    from collections.abc import Container, Iterable, Sequence

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.inference.bank import Bank
    from dbbstation.inference.model_comparison import Member


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums over one variable's bins for d directions.

    A gain is the effect of one prior standard deviation, over noise.

    Attributes:
        at: mean values of bins, shape (b,) or (b, c).
        place: numbers of bins from zero, shape (b,).
        rest: sums of gain times residual, shape (b, d).
        gains: sums of gain times gain, shape (b, d, d).
        base: sums of gain times base directions, shape (b, d, k).
    """

    at: Floats
    place: Integers
    rest: Floats
    gains: Floats
    base: Floats

    @classmethod
    def of(cls, values: Floats, piece: Integers, gain: Floats, rest: Floats, base: NDArray[np.floating]) -> Sums:
        """Return sums over bins.

        Args:
            values: of the variable, shape (n,) or (n, c).
            piece: number of each row's bin, shape (n,).
            gain: shape (n, d).
            rest: residual, shape (n,).
            base: directions, shape (n, k).
        """
        own, place, count = np.unique(piece, return_inverse=True, return_counts=True)
        many, directions = gain.shape
        rows, ends = np.argsort(place, kind="stable"), np.concatenate([[0], np.cumsum(count)])

        def added(samples: NDArray[np.floating], times: Floats | None = None) -> Floats:
            """Return sums over bins of samples times factors."""
            weights = np.ones(many) if times is None else times[rows]
            return csr_array((weights, rows, ends), shape=(len(count), many)) @ samples

        at = added(values.reshape(many, -1)) / count[:, None]
        return cls(
            at=at[:, 0] if values.ndim == 1 else at,
            place=own - own[0],
            rest=added(gain * rest[:, None]),
            gains=added(products_of_rows(gain, gain)).reshape(-1, directions, directions),
            base=np.stack([added(base, gain[:, d]) for d in range(directions)], axis=1),
        )

    def explained(self, curves: Floats) -> Floats:
        """Return the squares, shape (m,), that curves, shape (b, m, p), explain given the base."""
        pieces, many, count = curves.shape
        flat = curves.reshape(pieces, many * count).T
        rest = (flat @ self.rest).reshape(many, count, -1)
        base = (flat @ self.base.reshape(pieces, -1)).reshape(many, count, *self.base.shape[1:])
        pairs = (curves[:, :, :, None] * curves[:, :, None, :]).reshape(pieces, -1)
        gains = (pairs.T @ self.gains.reshape(pieces, -1)).reshape(many, count, count, *self.gains.shape[1:])
        return solved(rest, paired(gains) - taken(base))

    def of_forms(self, forms: Sequence[Form]) -> Floats:
        """Return squares explained by forms, shape (m,)."""
        curves = [form.columns(self.at) for form in forms]
        return self.explained(np.stack(curves, axis=1)) if curves else np.zeros(0)

    def of_waves(self, length: int, first: int, last: int) -> Floats:
        """Return squares explained by waves of `first` to `last` - 1 periods in `length` bins, by Fourier transform."""
        pieces, directions, width = self.base.shape

        def transformed(values: Floats, step: int) -> NDArray[np.complex128]:
            wide = np.zeros((length, values.shape[1]))
            wide[self.place] = values
            return rfft(wide, axis=0)[step * first : step * last : step]

        of_base = np.zeros((last - first, 2 * directions, 2 * directions))
        for column in range(0, width, BOUNDS.sums_at_once):
            some = self.base[:, :, column : column + BOUNDS.sums_at_once].reshape(pieces, -1)
            of_base += taken(sides(transformed(some, 1).reshape(last - first, directions, -1)))
        twice = transformed(self.gains.reshape(pieces, -1), 2).reshape(last - first, directions, directions)
        gains = squares(self.gains.sum(axis=0), twice)
        return solved(sides(transformed(self.rest, 1)), paired(gains) - of_base)

    def best(self, forms: Sequence[Form], most: int) -> list[tuple[float, Form]]:
        """Return the locally best forms of a list with explained squares, best first."""
        explained = self.of_forms(forms)
        return [(float(explained[k]), forms[k]) for k in peaks(explained, most)]

    def finer(self, frequencies: Iterable[float], extent: float) -> list[tuple[float, Wave]]:
        """Optimise waves near given frequencies; return waves with explained squares, best first.

        Waves near a frequency are this wave times a slow one, which is interpolated between few points. Only the
        interpolating polynomials need sums over bins.

        Args:
            extent: of the variable.
        """
        middle, half = 0.5 * (self.at.max() + self.at.min()), max(0.5 * float(np.ptp(self.at)), 1e-300)
        points = chebpts1(POINTS_OF_SLOW)
        between = chebvander((self.at - middle) / half, len(points) - 1) @ np.linalg.inv(
            chebvander(points, len(points) - 1)
        )
        found = []
        for first in frequencies:
            phase = 2.0 * np.pi * first * (self.at - middle)[:, None]
            rest, normal = self._sums_of(np.hstack([np.cos(phase) * between, np.sin(phase) * between]))
            best = first
            for step in FINER:
                near = best + np.arange(-15, 16) * step / extent
                near = near[near > 0.25 / extent]
                slow = 2.0 * np.pi * (near - first)[:, None] * half * points
                cosine, sine = np.cos(slow), np.sin(slow)
                waves = np.stack([np.hstack([cosine, -sine]), np.hstack([sine, cosine])], axis=1)
                along_first = np.tensordot(waves, normal, axes=1)
                explained = solved(waves @ rest, np.einsum("mpdje,mqj->mpdqe", along_first, waves))
                best = float(near[int(explained.argmax())])
            found.append((float(explained.max()), Wave(best)))
        return sorted(found, key=lambda one: -one[0])

    def _sums_of(self, curves: Floats) -> tuple[Floats, Floats]:
        """Return sums for curves, shape (b, i): of rest, (i, d), and of pairs less the base's part, (i, d, i, d)."""
        base = np.tensordot(curves, self.base, axes=(0, 0))
        gains = np.tensordot(curves[:, :, None, None] * self.gains[:, None], curves, axes=(0, 0))
        return curves.T @ self.rest, gains.transpose(0, 1, 3, 2) - np.tensordot(base, base, axes=(2, 2))


FINER = (1.0 / 30.0, 1.0 / 450.0)
"""Successive frequency steps, in units of one over the extent; the last gives the phase within a degree over the
extent."""

POINTS_OF_SLOW = 16
"""Points that interpolate a wave of half a period over the extent to 1e-14 [Chebyshev points of the first kind]."""


def peaks(explained: Floats, most: int) -> Integers:
    """Return local maxima, best first."""
    padded = np.concatenate([[-np.inf], explained, [-np.inf]])
    found = np.flatnonzero((explained >= padded[:-2]) & (explained >= padded[2:]))
    return found[np.argsort(-explained[found])][:most]


def bumps(low: float, high: float, widths: Iterable[float]) -> list[Form]:
    """Return bumps of given widths, not at the ends."""
    return [Bump(float(at), width) for width in widths for at in np.arange(low + width, high - width, width / 2.0)]


def steps(low: float, high: float, count: int) -> list[Form]:
    """Return sharp steps, not at the ends."""
    wide = (high - low) / count
    return [StepForm(float(at), wide / 4.0) for at in np.linspace(low, high, count + 1)[2:-2]] if wide > 0.0 else []


def sides(transform: NDArray[np.complex128]) -> Floats:
    """Return cosine and sine sums, shape (m, 2, ...), from sums with exp(-ix), shape (m, ...)."""
    return np.stack([transform.real, -transform.imag], axis=1)


def squares(mean: Floats, twice: NDArray[np.complex128]) -> Floats:
    """Return sums of cosine and sine products, shape (m, 2, 2, d, d), from sums with 1, (d, d), and exp(-2ix), (m, d, d)."""
    # cos² = (1 + cos 2x) / 2, sin² = (1 - cos 2x) / 2, sin cos = sin 2x / 2
    found = np.empty((len(twice), 2, 2, *mean.shape))
    found[:, 0, 0], found[:, 1, 1] = (mean + twice.real) / 2.0, (mean - twice.real) / 2.0
    found[:, 0, 1] = found[:, 1, 0] = -twice.imag / 2.0
    return found


def taken(base: Floats) -> Floats:
    """Return the base's part of curve products, (m, p d, p d), from sums of shape (m, p, d, k)."""
    side = base.reshape(len(base), base.shape[1] * base.shape[2], -1)
    return side @ side.transpose(0, 2, 1)


def paired(gains: Floats) -> Floats:
    """Return products of curves as matrices, shape (m, p d, p d), from shape (m, p, p, d, d)."""
    size = gains.shape[1] * gains.shape[3]
    return gains.transpose(0, 1, 3, 2, 4).reshape(len(gains), size, size)


def solved(rest: Floats, normal: Floats) -> Floats:
    """Return squares explained by columns, from residual sums (m, p, d), and products less `taken`, (m, p d, p d) or (m, p, d, p, d)."""
    many, size = len(rest), rest.shape[1] * rest.shape[2]
    right = rest.reshape(many, size, 1)
    return (right * np.linalg.solve(normal.reshape(many, size, size) + np.eye(size), right)).sum(axis=(1, 2))


PLACED = (Family.WAVE, Family.BUMP, Family.STEP)
"""Families whose place, width or frequency is a nonlinear parameter."""


WIDTHS = (64.0, 32.0, 16.0, 8.0)
"""Ratios of the range to standard deviations of bumps."""

FINER_CURVES = (2 * CURVES, 4 * CURVES)
"""Numbers of functions of more flexible curves."""

NEIGHBOUR = 0.7
"""Least ratio of squares explained by a form of the list to squares explained by the best nearby form: half a frequency
step gives sinc²(1/4) = 0.81, a bump half a step away and 1.4 times wider 0.92."""


def looked_for(left: Left, variables: Sequence[Variable], kept: Flags, size: float) -> list[Pattern]:
    """Find the best waves, bumps and steps over variables.

    Args:
        size: prior standard deviation, over noise.
    """
    found: list[Pattern] = []
    for variable in variables:
        values = variable.values[kept]
        distinct = len(np.unique(values))
        pieces = min(BOUNDS.pieces, distinct // 2, len(values) // BOUNDS.rows_per_piece)
        if pieces < 2 * BOUNDS.pieces_per_wave:
            continue
        sums = _sums(left, values, pieces, size)
        fine = pieces if variable.kind is Kind.TIME else min(BOUNDS.pieces, distinct)
        # In correlated noise the first scan does not know how much of a form remains after whitening.
        roughly = left.whitening is not None
        most = BOUNDS.strongest_coloured if roughly else BOUNDS.strongest
        finely = sums if fine == pieces else _sums(left, values, fine, size)
        found += _waves(variable, finely, float(np.ptp(values)), fine, most, roughly=roughly)
        finer = [n for n in FINER_CURVES if n * BOUNDS.pieces_per_wave <= pieces]
        found += [
            _pattern(variable, Family.CURVE, Spline(variable.low, variable.high, n), 1.0, f"{n} points") for n in finer
        ]
        if variable.kind is not Kind.TIME:
            widths = [variable.extent / w for w in WIDTHS if w <= pieces / 2]
            for family, forms, apart in (
                (Family.BUMP, bumps(variable.low, variable.high, widths), 3.0),
                (Family.STEP, steps(variable.low, variable.high, BOUNDS.step_places), 1.0),
            ):
                tried = max(len(forms) / apart, 1.0)  # neighbouring forms are correlated and count as fewer trials
                least = 0.0 if roughly else _least(tried)
                for explained, form in sums.best(forms, most):
                    if explained >= least:
                        (_, best), *_ = sums.best(_near(form), 1)
                        found.append(_pattern(variable, family, best, tried))
    return found


def _sums(left: Left, values: Floats, pieces: int, size: float) -> Sums:
    low, high = float(values.min()), float(values.max())
    piece = np.minimum(((values - low) / max(high - low, 1e-300) * pieces).astype(np.int64), pieces - 1)
    gain = np.full((len(values), 1), size)
    if left.whitening is None:
        return Sums.of(values, piece, gain, left.towards, left.beside)
    found = Sums.of(values, piece, gain, left.towards, left.beside[:, :0])
    # Whitening reduces a curve according to its rate of change; the first scan assumes the noise's factor.
    return replace(found, gains=found.gains * (left.coloured.innovation / left.coloured.sigma) ** 2)


def _waves(
    variable: Variable, sums: Sums, extent: float, pieces: int, strongest: int, *, roughly: bool
) -> list[Pattern]:
    length = 2 * (int(sums.place[-1]) + 1)
    last = min(int(2.0 * min(BOUNDS.cycles, pieces / BOUNDS.pieces_per_wave)), length // 4)
    if last <= 1:
        return []
    explained, tried = sums.of_waves(length, 1, last), (last - 1) / 2.0
    least = 0.0 if roughly else _least(tried)
    grid = np.arange(1, last) * pieces / (length * extent)
    found = sums.finer(
        [float(grid[k]) for k in peaks(explained, 2 * strongest) if explained[k] >= least], variable.extent
    )
    waves = [wave for _, wave in found[:strongest]]
    if variable.kind is not Kind.TIME:
        # The found frequency may be a multiple of the fundamental.
        pitches = [wave.frequency / k for wave in waves[: BOUNDS.strongest] for k in MULTIPLES]
        most = pieces / (2.0 * extent)
        waves += [Wave(f, h) for f in pitches if f > 2.0 / extent for h in HARMONICS if h * f < most]
    # Each fundamental and each number of harmonics is a further trial.
    beside = len(MULTIPLES) * len(HARMONICS)
    return [_pattern(variable, Family.WAVE, w, tried * (beside if w.harmonics > 1 else 1)) for w in waves]


MULTIPLES = (1, 2, 3)
"""Multiples of the fundamental that a wave's frequency may be."""


def _least(tried: float) -> float:
    return -2.0 * NEIGHBOUR * log_odds(1, tried)


def placed_better(pattern: Pattern, left: Left, kept: Flags, size: float) -> Pattern:
    """Return a pattern with refined frequency, place and width."""
    (variable,), form = pattern.variables, pattern.form
    if form is None:
        return pattern
    values = variable.values[kept]
    for finer in CLOSER:
        near = _moved(form, finer, variable.extent)
        explained = [_explained_by(left, left.whitened(one.columns(values)), size) for one in near]
        form = near[int(np.argmax(explained))]
    return _pattern(variable, pattern.family, form, pattern.tried)


def _explained_by(left: Left, columns: Floats, size: float) -> float:
    beside = columns - left.axes @ (left.axes.T @ columns)
    along = columns.T @ left.rest
    return float(along @ np.linalg.solve(columns.T @ beside + np.eye(columns.shape[1]) / size**2, along))


def _moved(form: Form, finer: float, extent: float) -> list[Form]:
    steps = (0.0, -1.0, 1.0, -2.0, 2.0)
    if isinstance(form, Bump):
        return [
            Bump(form.centre + 0.2 * away * finer * form.width, form.width * float(np.exp(0.15 * wider * finer)))
            for away in steps
            for wider in steps
        ]
    if isinstance(form, StepForm):
        return [StepForm(form.at + away * finer * form.width, form.width) for away in steps]
    if isinstance(form, Wave):
        finer /= form.harmonics
        return [
            Wave(max(form.frequency + away * finer * FINER[0] / extent, 0.25 / extent), form.harmonics)
            for away in steps
        ]
    return [form]


CLOSER = (1.0, 1.0, 0.3, 0.3, 0.1, 0.03)
"""Successive steps of refinement, in steps of the finest list."""


def _near(form: Form) -> list[Form]:
    if isinstance(form, Bump):
        return [
            Bump(form.centre + away * form.width, form.width * wider)
            for wider in (0.6, 0.7, 0.84, 1.0, 1.19, 1.41, 1.7)
            for away in np.arange(-0.5, 0.55, 0.1)
        ]
    if isinstance(form, StepForm):
        return [StepForm(form.at + away * form.width, form.width) for away in np.arange(-4.0, 4.1, 0.5)]
    return [form]


def _pattern(variable: Variable, family: Family, form: Form, tried: float, label: str = "") -> Pattern:
    label = label or " ".join(form.text(variable.unit).split()).replace(" ,", ",")
    return Pattern.plain(family, (variable,), form.columns(variable.values), form, label, tried)


IN_TIME = (Family.PULSES, Family.PULSES_BY_DIRECTION)
"""Families whose edges are nonlinear parameters, optimised for each noise."""

MOVED = (*IN_TIME, *PLACED)
"""Families whose places, edges, widths or frequencies are optimised."""


def seen(bank: Bank, members: Sequence[Member], *, in_time: bool) -> list[Pattern]:
    """Return significant patterns of the residual."""
    channel = bank.channel
    left = _left(bank, *_fitted(bank, members))
    size = channel.size / left.noise
    found = looked_for(left, channel.variables, channel.kept, size)
    if in_time and channel.time is not None:
        found += stretches(left, channel, size)
    return bank.worthy(left, found)


def _fitted(bank: Bank, members: Sequence[Member]) -> tuple[Floats, Floats]:
    known, held = bank.channel.known, bank.channel.held
    fixed, random = np.flatnonzero(~known.random), np.flatnonzero(known.random)
    base = bank.base
    columns = [base[:, fixed] @ free_directions(known, fixed, held), base[:, random]]
    sd = [np.full(columns[0].shape[1], np.inf), known.prior[random]]
    for member in members:
        columns.append(bank.fitted(member.columns))
        sd.append(member.sd)
    return np.hstack(columns), np.concatenate(sd)


def _left(bank: Bank, columns: Floats, sd: Floats) -> Left:
    return Left.of(columns, sd, bank.target, bank.noise, bank.whitening)


def places_anew(bank: Bank, members: Sequence[Member], among: Container[str]) -> tuple[Member, ...]:
    """Return members with places optimised for the present noise."""
    channel = bank.channel
    members = list(members)
    for number, member in enumerate(members):
        pattern = bank.patterns.get(member.name)
        if pattern is None or pattern.family not in MOVED or pattern.name not in among:
            continue
        others, sd = _fitted(bank, [*members[:number], *members[number + 1 :]])
        left, size = _left(bank, others, sd), channel.size / bank.noise.innovation
        if pattern.family in PLACED:
            better = placed_better(pattern, left, channel.kept, size)
        else:
            better = refined(pattern, left, member.sd[: member.width], channel, size)
        if better.name == pattern.name or better.name in bank.patterns:
            continue
        bank.drop({pattern.name})
        bank.add([better])
        cause = next(cause for cause in bank.causes if cause.name == better.name)
        members[number] = replace(member, cause=cause, variant=cause.widest)
    return tuple(members)
