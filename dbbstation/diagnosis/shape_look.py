"""Search for waves, bumps and steps beside a refitted base."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len
from scipy.linalg import qr
from scipy.sparse import csr_array

from dbbstation.diagnosis.shapes import (
    BALL,
    EVERY,
    OF_STRUTS,
    PLAUSIBLE_MM,
    READING,
    TABLE,
    TOOL,
    Ranges,
    Samples,
    Shape,
)
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.forms import Form, Lobes, PlaneStep, Ringing, Wave, WaveOfTurn
from dbbstation.inference.square_root import free_directions
from dbbstation.inference.sums import Sums, bumps, peaks, steps
from dbbstation.machine.geometry import STRUTS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.inference.blocks import Columns

PIECE_MM = 0.5
"""Of strut length, for waves down to 4 mm [mm]."""

SHORTEST_MM = 4.0
"""Shortest wave of strut length that is looked for [mm]."""

SHORTEST_S = 3.0
"""Shortest wave of time that is looked for; four pieces where the recordings last longer than that allows [s]."""

WIDTHS_MM = (3.0, 5.0, 8.0, 13.0, 20.0)
"""Standard deviations of bumps of strut length: dents and bent covers [mm]."""

LOBES_ALONE = tuple(range(2, 31))
"""Numbers of lobes that are looked for one at a time."""

WAVES_PER_TURN = np.arange(0.2, 20.0, 0.05)
"""Waves of the angle since the start: they need not close."""

ACROSS_DEG = np.arange(0.0, 180.0, 15.0)
LINE_WIDTHS_MM = (5.0, 20.0)
"""Lines in the plane that a table may tip over at: their directions [deg] and widths [mm]."""

RINGING_PERIODS_S = np.geomspace(0.2, 2.5, 40)
"""What a drive's position loop or its mounting oscillates with, in steps of 7 %: a ringing of three periods is then found but for a tenth."""

RINGING_DECAYS_S = (0.4, 0.8, 1.6, 3.2)
"""Times over which it fades, a period at the least: what is gone before it has swung back once is a spike, which has a name."""

RINGS = tuple(
    Ringing(float(period_s), decay_s)
    for decay_s in RINGING_DECAYS_S
    for period_s in RINGING_PERIODS_S
    if period_s <= decay_s
)

RINGING_PIECE_S = 0.02
"""A tenth of the shortest period."""

RINGING_S = 12.0
"""Time since a reversal beyond which nothing rings any more."""

PLACE_MM = 5.0
"""Of the platform's position, either way [mm]."""


@dataclass(frozen=True, eq=False)
class _Over:
    """Sums over a variable of one mover, whose best forms are shapes."""

    sums: Sums
    variable: str
    strut: int | None
    moves: str

    def best(self, kind: str, forms: Sequence[Form], apart: float = 1.0) -> list[Shape]:
        """Return the best forms of a list of which every so many-th counts as a try."""
        tried = max(len(forms) / apart, 1.0)
        return self._shapes(kind, self.sums.best(forms, BOUNDS.strongest), tried)

    def waves(self, grid: Floats, explained: Floats) -> list[Shape]:
        """Return the best waves about the best of a grid."""
        begun = [float(grid[k]) for k in peaks(explained, BOUNDS.made_finer)]
        found = self.sums.finer(begun, float(np.ptp(self.sums.at)))
        return self._shapes("wave", found[: BOUNDS.strongest], len(grid) / 2.0)

    def _shapes(self, kind: str, found: Sequence[tuple[float, Form]], tried: float) -> list[Shape]:
        own = self.variable, kind, self.strut, self.moves
        return [Shape(*own, form, tried, explained) for explained, form in found]


class TemplateScan:
    """A fit's residual and base directions, in noise.

    Args:
        jacobian: shape (n, k) each, used once.
    """

    def __init__(
        self,
        runs: Sequence[Samples],
        residual: Sequence[Floats],
        jacobian: Iterable[Floats],
        base: Columns,
        held: Floats,
        noise_mm: float,
    ) -> None:
        self._runs, self._noise = runs, noise_mm
        random, fitted = np.flatnonzero(base.random), np.flatnonzero(~base.random)
        free = free_directions(base, fitted, held)
        ends = np.cumsum([0, *(len(own) for own in residual)])
        # Filled run by run and made orthonormal in place: copies of all columns would need more memory than all else here.
        columns = np.zeros((ends[-1] + len(random), free.shape[1] + len(random)), order="F")
        for own, start, stop in zip(jacobian, ends[:-1], ends[1:], strict=True):
            columns[start:stop, : free.shape[1]] = own[:, fitted] @ (free / noise_mm)
            columns[start:stop, free.shape[1] :] = own[:, random] / noise_mm
        np.fill_diagonal(columns[ends[-1] :, free.shape[1] :], 1.0 / base.prior[random])
        # Readings only: what the rows of the priors take part in is no reading.
        # Row by row in memory, as sums over rows ask for them.
        self._base = np.ascontiguousarray(
            qr(columns, overwrite_a=True, mode="economic", check_finite=False)[0][: ends[-1]]
        )
        self._rest = np.concatenate(residual) / noise_mm

    def over(
        self, variable: str, strut: int | None, moves: str, pieces: Callable[[Floats], Integers] | tuple[float, float]
    ) -> _Over:
        """Sum over pieces of a variable, or over even ones from a place on of some width."""
        own = partial(_piece, low=pieces[0], width=pieces[1]) if isinstance(pieces, tuple) else pieces
        return _Over(self.sums(variable, strut, moves, own), variable, strut, moves)

    def sums(self, variable: str, strut: int | None, moves: str, pieces: Callable[[Floats], Integers]) -> Sums:
        """Sum over pieces of a variable."""
        values = np.concatenate([run.values[variable] for run in self._runs])
        gain = np.vstack([run.gain[moves] for run in self._runs])
        if strut is not None:
            gain = gain[:, strut - 1 : strut]
            values = values[:, strut - 1] if variable in OF_STRUTS else values
        gain = gain * (PLAUSIBLE_MM / self._noise)
        own, piece, number = np.unique(pieces(values), return_inverse=True, return_counts=True)
        many, directions = len(values), gain.shape[1]
        rows = np.argsort(piece, kind="stable")
        ends = np.concatenate([[0], np.cumsum(number)])

        def added(samples: NDArray[np.floating], times: Floats | None = None) -> Floats:
            """Return samples summed over pieces with factors."""
            weights = np.ones(many) if times is None else times[rows]
            return np.asarray(csr_array((weights, rows, ends), shape=(len(number), many)) @ samples, dtype=np.float64)

        at = added(values.reshape(many, -1)) / number[:, None]
        products = (gain[:, :, None] * gain[:, None, :]).reshape(many, -1)
        return Sums(
            at=at[:, 0] if values.ndim == 1 else at,
            place=own - own[0],
            rest=added(gain * self._rest[:, None]),
            gains=added(products).reshape(-1, directions, directions),
            base=np.stack([added(self._base, gain[:, d]) for d in range(directions)], axis=1),
        )


def looked_for(look: TemplateScan, extent: Ranges) -> list[Shape]:
    """Return the best shapes of every visible kind."""
    found: list[Shape] = []
    for strut in range(1, STRUTS + 1):
        low, high = (float(limit["strut-length"][strut - 1]) for limit in (extent.low, extent.high))
        lengths = look.over("strut-length", strut, EVERY, (low, PIECE_MM))
        grid = np.arange(0.5, (high - low) / SHORTEST_MM, 0.5) / (high - low)
        found += lengths.waves(grid, lengths.sums.of_forms([Wave(float(frequency)) for frequency in grid]))
        found += lengths.best("bump", bumps(low, high, WIDTHS_MM), _BUMPS_APART)
        found += lengths.best("step", steps(low, high, _STEPS))
        if "strut-force" in extent.low:
            low, high = (float(limit["strut-force"][strut - 1]) for limit in (extent.low, extent.high))
            forces = look.over("strut-force", strut, EVERY, (low, max(high - low, 1e-6) / _FORCES))
            found += forces.best("step", steps(low, high, _STEPS))
    if "time" in extent.low:
        low, high = float(extent.low["time"]), float(extent.high["time"])
        wide = max(SHORTEST_S / 4.0, (high - low) / BOUNDS.pieces_of_travel)
        movers: list[tuple[int | None, str]] = [(None, READING), (None, BALL)]
        for own, moves in (*movers, *((strut, EVERY) for strut in range(1, STRUTS + 1))):
            times = look.over("time", own, moves, (low, wide))
            length = next_fast_len(2 * (int(times.sums.place[-1]) + 1), real=True)
            first, last = max(1, int(np.floor(0.5 * length * wide / (high - low)))), length // 4
            found += times.waves(np.arange(first, last) / (length * wide), times.sums.of_waves(length, first, last))
            found += times.best("step", steps(low, high, _TIMES))
    if "time since its reversal" in extent.low:
        for strut in range(1, STRUTS + 1):
            found += look.over("time since its reversal", strut, EVERY, _since).best("ringing", RINGS, _RINGS_APART)
    if "angle" in extent.low:
        found += look.over("angle", None, READING, (0.0, 1.0)).best("wave", [Lobes((k,)) for k in LOBES_ALONE])
        waves = [WaveOfTurn(float(f)) for f in WAVES_PER_TURN]
        for moves in (READING, TOOL):
            found += look.over("angle since the start", None, moves, (-1.5, _TURN)).best("wave", waves, _TURNS_APART)
    for moves in (BALL, TABLE):
        places = look.over("position of the platform", None, moves, _place)
        found += places.best("step", _lines(places.sums.at), _LINES_APART)
    return _shared(found, extent)


def _shared(found: Sequence[Shape], extent: Ranges) -> list[Shape]:
    """Return one strut's waves and ringing on all struts, since forms of two may be indistinguishable."""
    kept: list[Shape] = []
    for shape in sorted(found, key=lambda one: -one.explained):
        if shape.strut is None or shape.kind not in {"wave", "ringing"}:
            kept.append(shape)
        elif not any(_is_one(shape, other, extent) for other in kept):
            kept += [replace(shape, strut=strut) for strut in range(1, STRUTS + 1)]
    return kept


def _is_one(one: Shape, other: Shape, extent: Ranges) -> bool:
    """Return whether two forms differ by less than half a wave or a few scan steps."""
    if other.strut is None or one.follows != other.follows:
        return False
    if isinstance(one.form, Wave) and isinstance(other.form, Wave):
        length = float(np.max(extent.high[one.variable] - extent.low[one.variable]))
        return abs(one.form.frequency - other.form.frequency) * length < HALF
    if isinstance(one.form, Ringing) and isinstance(other.form, Ringing):
        step = float(np.log(RINGING_PERIODS_S[1] / RINGING_PERIODS_S[0]))
        return abs(float(np.log(one.form.period / other.form.period))) < HALF * _RINGS_APART * step
    return False


HALF = 0.5
"""Of a wave over the extent, and of the neighbours that are about the same: two forms that differ by less lie between the same two
independent ones."""


_FORCES, _TIMES, _STEPS = 200, 100, 40
_TURN = 1.0 / 360.0
_BUMPS_APART, _TURNS_APART, _LINES_APART, _RINGS_APART = 3.0, 4.0, 6.0, 4.0
"""How many neighbours in a list of forms are about the same: only every so many-th counts as another try."""


def _piece(values: Floats, low: float, width: float) -> Integers:
    return np.floor((values - low) / width).astype(np.int64)


def _since(values: Floats) -> Integers:
    return np.round(np.clip(values, -RINGING_S, RINGING_S) / RINGING_PIECE_S).astype(np.int64)


def _place(values: Floats) -> Integers:
    x, y = np.floor(values / PLACE_MM).astype(np.int64).T
    return np.asarray(x * 100_000 + y, dtype=np.int64)


def _lines(places: Floats) -> list[Form]:
    found: list[Form] = []
    for across in ACROSS_DEG:
        along = PlaneStep(float(across), 0.0, 1.0).along(places)
        for width in LINE_WIDTHS_MM:
            lines = np.arange(along.min() + 2 * width, along.max() - 2 * width, max(width, 2 * PLACE_MM))
            found += [PlaneStep(float(across), float(at), width) for at in lines]
    return found
