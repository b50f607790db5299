"""Search a residual for waves, bumps, steps and pulses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.curves import Spline
from dbbstation.inference.forms import HARMONICS, Bump, StepForm, Wave
from dbbstation.inference.patterns import Family, Pattern, log_odds
from dbbstation.inference.sums import FINER, Sums, bumps, peaks, steps
from dbbstation.inference.variables import Kind

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.inference.forms import Form
    from dbbstation.inference.pieces import Left
    from dbbstation.inference.variables import Variable

PLACED = (Family.WAVE, Family.BUMP, Family.STEP)
"""Families whose place, width or frequency is a nonlinear parameter."""

ROWS_PER_PIECE = 4
"""Least average rows per bin of a variable; 1 for waves except over time, because four rows can be a wave."""

PIECES_PER_WAVE = 4
"""Bins in the shortest wave."""

WIDTHS = (64.0, 32.0, 16.0, 8.0)
"""Ratios of the range to standard deviations of bumps."""

FINER_CURVES = (14, 28)
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
        pieces = min(BOUNDS.pieces, distinct // 2, len(values) // ROWS_PER_PIECE)
        if pieces < 2 * PIECES_PER_WAVE:
            continue
        sums = _sums(left, values, pieces, size)
        fine = pieces if variable.kind is Kind.TIME else min(BOUNDS.pieces, distinct)
        # In correlated noise the first scan does not know how much of a form remains after whitening.
        roughly = left.whitening is not None
        most = BOUNDS.strongest_coloured if roughly else BOUNDS.strongest
        finely = sums if fine == pieces else _sums(left, values, fine, size)
        found += _waves(variable, finely, float(np.ptp(values)), fine, most, roughly=roughly)
        finer = [n for n in FINER_CURVES if n * PIECES_PER_WAVE <= pieces]
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
    place = np.minimum(((values - low) / max(high - low, 1e-300) * pieces).astype(np.int64), pieces - 1)
    own, number, count = np.unique(place, return_inverse=True, return_counts=True)
    order = np.argsort(number, kind="stable")
    starts = np.concatenate([[0], np.cumsum(count)[:-1]])

    def added(rows: Floats) -> Floats:
        return np.add.reduceat(rows[order], starts, axis=0)

    squares, base = np.asarray(count * size**2, dtype=np.float64), size * added(left.beside)
    if left.whitening is not None:
        # Whitening reduces a curve according to its rate of change; the first scan assumes the noise's factor.
        squares, base = squares * (left.coloured.innovation / left.coloured.sigma) ** 2, base[:, :0]
    return Sums(
        added(values) / count, own, size * added(left.towards)[:, None], squares[:, None, None], base[:, None, :]
    )


def _waves(
    variable: Variable, sums: Sums, extent: float, pieces: int, strongest: int, *, roughly: bool
) -> list[Pattern]:
    length = 2 * (int(sums.place[-1]) + 1)
    last = min(int(2.0 * min(BOUNDS.cycles, pieces / PIECES_PER_WAVE)), length // 4)
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
