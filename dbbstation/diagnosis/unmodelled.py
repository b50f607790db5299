"""Unmodelled effects as causes, and the search of the residual for them with the base refitted."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len
from scipy.linalg import qr

from dbbstation.calibration.fit.calibrate import SMALLEST_NOISE_MM
from dbbstation.computing.grouped import grouped
from dbbstation.diagnosis.parts import ALIKE
from dbbstation.diagnosis.shapes import (
    BALL,
    EVERY,
    OF_STRUTS,
    PLAUSIBLE_MM,
    READING,
    TABLE,
    TOOL,
    Follows,
    Ranges,
    Samples,
    Shape,
    ranges,
    samples_of,
    shapes,
    wander,
)
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.forms import Form, Lobes, PlaneStep, Ringing, Wave, WaveOfTurn
from dbbstation.inference.looks import Sums, bumps, peaks, steps
from dbbstation.inference.model_comparison import Cause, Variant, all_columns
from dbbstation.inference.patterns import FAMILY_ODDS
from dbbstation.inference.square_root import free_directions, with_random
from dbbstation.machine.geometry import STRUT_NUMBERS, STRUTS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.diagnosis.channel import CircleChannel
    from dbbstation.inference.model_comparison import Member
    from dbbstation.inference.square_root import Columns


WIDTHS_MM = (3.0, 5.0, 8.0, 13.0, 20.0)
"""Standard deviations of bumps of strut length: dents and bent covers [mm]."""

LOBES_ALONE = tuple(range(2, 31))
"""Numbers of lobes searched separately."""

WAVES_PER_TURN = np.arange(0.2, 20.0, 0.05)
"""Waves per turn of the angle since the start; they need not be integers."""

ACROSS_DEG = np.arange(0.0, 180.0, 15.0)
LINE_WIDTHS_MM = (5.0, 20.0)
"""Lines at which a table may tip: directions [deg] and widths [mm]."""

RINGING_PERIODS_S = np.geomspace(0.2, 2.5, 40)
"""Periods of a drive's position loop or mounting, in steps of 7 %, which finds nine tenths of a ringing over three periods."""

RINGING_DECAYS_S = (0.4, 0.8, 1.6, 3.2)
"""Decay times of a ringing, at least one period; faster decay is a spike, a named cause."""

RINGS = tuple(
    Ringing(float(period_s), decay_s)
    for decay_s in RINGING_DECAYS_S
    for period_s in RINGING_PERIODS_S
    if period_s <= decay_s
)


@dataclass(frozen=True, eq=False)
class _Over:
    """Sums over one strut's variable, to find its best forms."""

    sums: Sums
    variable: str
    strut: int | None
    moves: str

    def best(self, kind: str, forms: Sequence[Form], apart: float = 1.0) -> list[Shape]:
        """Return the best forms of a list; neighbouring forms count as fewer trials."""
        tried = max(len(forms) / apart, 1.0)
        return self._shapes(kind, self.sums.best(forms, BOUNDS.strongest), tried)

    def waves(self, grid: Floats, explained: Floats) -> list[Shape]:
        """Return the best waves, refined from a grid."""
        begun = [float(grid[k]) for k in peaks(explained, BOUNDS.made_finer)]
        found = self.sums.finer(begun, float(np.ptp(self.sums.at)))
        return self._shapes("wave", found[: BOUNDS.strongest], len(grid) / 2.0)

    def _shapes(self, kind: str, found: Sequence[tuple[float, Form]], tried: float) -> list[Shape]:
        own = self.variable, kind, self.strut, self.moves
        return [Shape(*own, form, tried, explained) for explained, form in found]


class TemplateScan:
    """A fit's residual and base directions, over noise.

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
        # Filled per run and orthonormalised in place, because copies would dominate memory.
        columns = np.zeros((ends[-1] + len(random), free.shape[1] + len(random)), order="F")
        for own, start, stop in zip(jacobian, ends[:-1], ends[1:], strict=True):
            columns[start:stop, : free.shape[1]] = own[:, fitted] @ (free / noise_mm)
            columns[start:stop, free.shape[1] :] = own[:, random] / noise_mm
        np.fill_diagonal(columns[ends[-1] :, free.shape[1] :], 1.0 / base.prior[random])
        # Readings only, without rows of priors. Contiguous rows, for sums over rows.
        self._base = np.ascontiguousarray(
            qr(columns, overwrite_a=True, mode="economic", check_finite=False)[0][: ends[-1]]
        )
        self._rest = np.concatenate(residual) / noise_mm

    def over(
        self, variable: str, strut: int | None, moves: str, pieces: Callable[[Floats], Integers] | tuple[float, float]
    ) -> _Over:
        """Return sums over bins of a variable, or over equal bins of given start and width."""
        own = partial(_piece, low=pieces[0], width=pieces[1]) if isinstance(pieces, tuple) else pieces
        return _Over(self.sums(variable, strut, moves, own), variable, strut, moves)

    def sums(self, variable: str, strut: int | None, moves: str, pieces: Callable[[Floats], Integers]) -> Sums:
        """Return sums over bins of a variable."""
        values = np.concatenate([run.values[variable] for run in self._runs])
        gain = np.vstack([run.gain[moves] for run in self._runs])
        if strut is not None:
            gain = gain[:, strut - 1 : strut]
            values = values[:, strut - 1] if variable in OF_STRUTS else values
        return Sums.of(values, pieces(values), gain * (PLAUSIBLE_MM / self._noise), self._rest, self._base)


def looked_for(look: TemplateScan, extent: Ranges) -> list[Shape]:
    """Return the best shapes of each kind that the runs can show."""
    found: list[Shape] = []
    for strut in STRUT_NUMBERS:
        low, high = extent.of("strut-length", strut)
        lengths = look.over("strut-length", strut, EVERY, (low, BOUNDS.wave_mm / 8.0))
        grid = np.arange(0.5, (high - low) / BOUNDS.wave_mm, 0.5) / (high - low)
        found += lengths.waves(grid, lengths.sums.of_forms([Wave(float(frequency)) for frequency in grid]))
        found += lengths.best("bump", bumps(low, high, WIDTHS_MM), _BUMPS_APART)
        found += lengths.best("step", steps(low, high, _STEPS))
        if "strut-force" in extent.low:
            low, high = extent.of("strut-force", strut)
            forces = look.over("strut-force", strut, EVERY, (low, max(high - low, 1e-6) / _FORCES))
            found += forces.best("step", steps(low, high, _STEPS))
    if "time" in extent.low:
        low, high = extent.of("time")
        wide = max(BOUNDS.wave_s / 4.0, (high - low) / BOUNDS.pieces_of_travel)
        movers: list[tuple[int | None, str]] = [(None, READING), (None, BALL)]
        for own, moves in (*movers, *((strut, EVERY) for strut in STRUT_NUMBERS)):
            times = look.over("time", own, moves, (low, wide))
            length = next_fast_len(2 * (int(times.sums.place[-1]) + 1), real=True)
            first, last = max(1, int(np.floor(0.5 * length * wide / (high - low)))), length // 4
            found += times.waves(np.arange(first, last) / (length * wide), times.sums.of_waves(length, first, last))
            found += times.best("step", steps(low, high, _TIMES))
    if "time since its reversal" in extent.low:
        for strut in STRUT_NUMBERS:
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
    """Return waves and ringing of one strut also for all struts, because two struts' forms may be indistinguishable."""
    kept: list[Shape] = []
    for shape in sorted(found, key=lambda one: -one.explained):
        if shape.strut is None or shape.kind not in {"wave", "ringing"}:
            kept.append(shape)
        elif not any(_is_one(shape, other, extent) for other in kept):
            kept += [replace(shape, strut=strut) for strut in STRUT_NUMBERS]
    return kept


def _is_one(one: Shape, other: Shape, extent: Ranges) -> bool:
    """Return whether two forms differ by less than half a wave, or by few steps of the search."""
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
"""Half a wave over the extent, or half of the correlated neighbours: closer forms are between the same two independent
forms."""


_FORCES, _TIMES, _STEPS = 200, 100, 40
_TURN = 1.0 / 360.0
_BUMPS_APART, _TURNS_APART, _LINES_APART, _RINGS_APART = 3.0, 4.0, 6.0, 4.0
"""Numbers of correlated neighbours in lists of forms, which count as one trial."""


def _piece(values: Floats, low: float, width: float) -> Integers:
    return np.floor((values - low) / width).astype(np.int64)


def _since(values: Floats) -> Integers:
    most, piece = BOUNDS.ringing_s, RINGING_PERIODS_S[0] / 10.0
    return np.round(np.clip(values, -most, most) / piece).astype(np.int64)


def _place(values: Floats) -> Integers:
    x, y = np.floor(values / BOUNDS.place_mm).astype(np.int64).T
    return x * 100_000 + y


def _lines(places: Floats) -> list[Form]:
    found: list[Form] = []
    for across in ACROSS_DEG:
        along = PlaneStep(float(across), 0.0, 1.0).along(places)
        for width in LINE_WIDTHS_MM:
            lines = np.arange(along.min() + 2 * width, along.max() - 2 * width, max(width, 2 * BOUNDS.place_mm))
            found += [PlaneStep(float(across), float(at), width) for at in lines]
    return found


@dataclass(eq=False)
class Unmodelled:
    """A channel's unmodelled effects, extensible.

    Attributes:
        shapes: by cause and form; per strut if each has its own.
    """

    channel: CircleChannel
    runs: list[Samples] = field(init=False)
    follows: dict[str, Follows] = field(default_factory=dict)
    shapes: dict[tuple[str, str], tuple[Shape, ...]] = field(default_factory=dict)
    causes: list[Cause] = field(default_factory=list)
    _looked_for: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        channel = self.channel
        pivot = np.mean([observation.setup.fixed_ball_mm for observation in channel.observations], axis=0)
        self.runs = [
            samples_of(known, motion, channel.machine, reading, pivot)
            for known, motion, reading in zip(channel.variables, channel.motions, channel.readings, strict=True)
        ]
        self._add([*shapes(ranges(self.runs)), *wander(self.runs)])

    def look(self, fit: Calibration, best: Sequence[Member], noise_mm: float) -> None:
        """Search the residual of base and named causes for waves, bumps, steps and pulses, and add them.

        Effects of earlier searches outside the best set are dropped first.
        """
        members = [member for member in best if member.cause.named]
        channel = self.channel
        known = with_random(channel.base, [member.sd for member in members])
        own = channel.columns
        base = (np.hstack([own.base[rows], own.samples[rows][:, all_columns(members)]]) for rows in channel.runs)
        noise_mm = max(noise_mm, SMALLEST_NOISE_MM)
        # The scan has a copy of the base, which no effect that is added needs.
        found = looked_for(
            TemplateScan(self.runs, list(fit.residual_mm), base, known, channel.held, noise_mm), ranges(self.runs)
        )
        self._forget(self._looked_for - {member.name for member in best})
        before = set(self.follows)
        self._add(found)
        self._looked_for |= set(self.follows) - before

    def of(self, member: Member) -> tuple[Shape, ...]:
        """Return shapes of an effect's form; empty for named causes."""
        return self.shapes.get((member.name, member.variant.label), ())

    def _forget(self, names: set[str]) -> None:
        gone = [variant for cause in self.causes if cause.name in names for variant in cause.variants]
        self.channel.columns.give_back(np.unique(all_columns(gone)))
        self.causes = [cause for cause in self.causes if cause.name not in names]
        self.follows = {name: follows for name, follows in self.follows.items() if name not in names}
        self._looked_for -= names

    def _add(self, more: Sequence[Shape]) -> None:
        families = grouped((name, shape) for shape in more if (name := _name(shape)) not in self.follows)
        more = [shape for family in families.values() for shape in family]
        if not more:
            return
        samples = np.empty((self.channel.runs[-1].stop, sum(shape.columns(self.runs[0]).shape[1] for shape in more)))
        for rows, run in zip(self.channel.runs, self.runs, strict=True):
            np.concatenate([shape.columns(run) for shape in more], axis=1, out=samples[rows])
        columns = self.channel.columns.add(samples)
        for name, family in families.items():
            counts = np.cumsum([shape.columns(self.runs[0]).shape[1] for shape in family])
            own, columns = np.split(columns[: counts[-1]], counts[:-1]), columns[counts[-1] :]
            odds = FAMILY_ODDS - float(np.log(KINDS * family[0].tried))
            self.follows[name] = family[0].follows
            self.causes.append(Cause(name, tuple(self._variants(name, family, own)), odds, named=False))

    def _variants(self, name: str, family: Sequence[Shape], columns: Sequence[Integers]) -> Iterator[Variant]:
        forms: list[tuple[tuple[Shape, ...], Integers]] = [
            ((shape,), own) for shape, own in zip(family, columns, strict=True)
        ]
        single = [form for form in forms if form[0][0].strut is not None]
        if len(single) == STRUTS:
            forms.append((tuple(some[0] for some, _ in single), np.concatenate([own for _, own in single])))
        kinds = [[form for form in forms if _label(form[0]).startswith(kind)] for kind in ("strut", ALIKE, EACH)]
        kinds = [kind for kind in kinds if kind]
        for kind in kinds:
            for some, own in kind:
                self.shapes[name, _label(some)] = some
                weight = -float(np.log(len(kinds) * len(kind)))
                yield Variant(own, np.full(len(own), PLAUSIBLE_MM), label=_label(some), log_weight=weight)


EACH = "each strut its own"
"""Label of the form with a separate curve for each strut."""

KINDS = 30
"""Approximate number of combinations of variable, kind of curve and moved part."""


def _label(shapes: Sequence[Shape]) -> str:
    if len(shapes) > 1:
        return EACH
    return f"strut {shapes[0].strut}" if shapes[0].strut else ALIKE


def _name(shape: Shape) -> str:
    """Return the name of a shape's cause; bumps and steps belong to one strut."""
    own = f", strut {shape.strut}" if shape.strut and shape.kind in {"bump", "step"} else ""
    text = shape.form.text("")
    return f"unmodelled: {shape.follows}{own}{', ' + text if text else ''}"
