"""A look for waves, bumps, steps and pulses in what a fit leaves: which of many forms the rows follow best.

Nobody says where or when. The number of independent forms that one was picked from counts against it [look-elsewhere effect:
Gross and Vitells, Eur. Phys. J. C 70 (2010) 525].
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.curves import Spline
from dbbstation.inference.forms import Bump, Step, Wave
from dbbstation.inference.patterns import Family, Pattern
from dbbstation.inference.pieces import Sums, peaks
from dbbstation.inference.variables import Kind

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.inference.forms import Form
    from dbbstation.inference.pieces import Left
    from dbbstation.inference.variables import Variable

STRONGEST = 2
"""Forms of each kind over each variable that are kept."""

STRONGEST_COLOURED = 6
"""The same where noise is not white: a first look does not know there how much of each form whitening leaves."""

PIECES = 2048
"""Of a variable, at the most."""

ROWS_PER_PIECE = 4
"""Rows in a piece of a variable, at the least, on average."""

PIECES_PER_WAVE = 4
"""Pieces in the shortest wave."""

MOST_CYCLES = 400
"""Periods over the range of a variable, at the most."""

WIDTHS = (64.0, 32.0, 16.0, 8.0)
"""Standard deviations of bumps: shares of the range, one over."""

FINER_CURVES = (14, 28)
"""Functions of curves that bend more often than the usual one."""

STEPS = 40
"""Places where a step is looked for."""

FINER = (1.0 / 30.0, 1.0 / 450.0)
"""Steps of frequency about the best one, as shares of one over the range: the last keeps the phase to a degree."""


def looked_for(left: Left, variables: Sequence[Variable], kept: NDArray[np.bool_], size: float) -> list[Pattern]:
    """Waves, bumps and steps over variables that the rows follow best.

    Args:
        left: what a fit leaves of the rows that were kept.
        variables: over all rows.
        kept: which rows were fitted, shape (n,).
        size: of an effect, one standard deviation, in units of noise.
    """
    found: list[Pattern] = []
    for variable in variables:
        values = variable.values[kept]
        pieces = min(PIECES, len(np.unique(values)) // 2, len(values) // ROWS_PER_PIECE)
        if pieces < 2 * PIECES_PER_WAVE:
            continue
        sums = Sums.over(left, values, pieces)
        most = STRONGEST if left.whitening is None else STRONGEST_COLOURED
        found += _waves(variable, sums, size, pieces, most)
        finer = [n for n in FINER_CURVES if n * PIECES_PER_WAVE <= pieces]
        found += [
            _pattern(variable, Family.CURVE, Spline(variable.low, variable.high, n), 1.0, f"{n} points") for n in finer
        ]
        if variable.kind is not Kind.TIME:
            found += _best(variable, Family.BUMP, sums, _bumps(variable, pieces), size, 3.0, most)
            found += _best(variable, Family.STEP, sums, _steps(variable), size, 1.0, most)
    return found


def _waves(variable: Variable, sums: Sums, size: float, pieces: int, strongest: int) -> list[Pattern]:
    """Waves of all periods from twice the range to four pieces, made finer about the best."""
    extent = variable.extent
    most = min(MOST_CYCLES, pieces / PIECES_PER_WAVE)
    grid = np.arange(0.5, most, 0.5) / extent
    if not len(grid):
        return []
    explained = np.concatenate(
        [sums.explained(_cosines(sums.at, part), size) for part in np.array_split(grid, 1 + len(grid) // 128)]
    )
    found: list[tuple[float, Wave]] = []
    for k in peaks(explained, 2 * strongest):
        best = grid[k]
        top = float(explained[k])
        for step in FINER:
            near = best + np.arange(-15, 16) * step / extent
            near = near[near > 0.25 / extent]
            by_near = sums.explained(_cosines(sums.at, near), size)
            best, top = near[int(by_near.argmax())], float(by_near.max())
        found.append((top, Wave(float(best))))
    found.sort(key=lambda one: -one[0])
    return [_pattern(variable, Family.WAVE, wave, len(grid) / 2.0) for _, wave in found[:strongest]]


def _best(
    variable: Variable, family: Family, sums: Sums, forms: Sequence[Form], size: float, apart: float, strongest: int
) -> list[Pattern]:
    """Forms that explain more than their neighbours in the list; only every so many-th counts as another try."""
    if not forms:
        return []
    tried = max(len(forms) / apart, 1.0)
    found = []
    for k in peaks(_explained(sums, forms, size), strongest):
        near = _near(forms[k])
        best = near[int(_explained(sums, near, size).argmax())]
        found.append(_pattern(variable, family, best, tried))
    return found


def _explained(sums: Sums, forms: Sequence[Form], size: float) -> NDArray[np.float64]:
    return sums.explained(np.stack([form.columns(sums.at) for form in forms], axis=1), size)


def _near(form: Form) -> list[Form]:
    """Forms between a form of the list and its neighbours."""
    if isinstance(form, Bump):
        return [
            Bump(form.centre + away * form.width, form.width * wider)
            for wider in (0.6, 0.7, 0.84, 1.0, 1.19, 1.41, 1.7)
            for away in np.arange(-0.5, 0.55, 0.1)
        ]
    if isinstance(form, Step):
        return [Step(form.at + away * form.width, form.width) for away in np.arange(-4.0, 4.1, 0.5)]
    return [form]


def _pattern(variable: Variable, family: Family, form: Form, tried: float, label: str = "") -> Pattern:
    samples = form.columns(variable.values)
    width = samples.shape[1]
    return Pattern(
        family,
        (variable,),
        samples,
        form,
        ("",) * width,
        (1.0,) * width,
        label or form.text(variable.unit).strip(),
        tried,
    )


def _bumps(variable: Variable, pieces: int) -> list[Form]:
    low, high, extent = variable.low, variable.high, variable.extent
    widths = [extent / w for w in WIDTHS if w <= pieces / 2]
    return [Bump(float(at), w) for w in widths for at in np.arange(low + w, high - w, w / 2.0)]


def _steps(variable: Variable) -> list[Form]:
    wide = variable.extent / STEPS
    places = np.linspace(variable.low, variable.high, STEPS + 1)[2:-2]
    return [Step(float(at), wide / 4.0) for at in places]


def _cosines(at: NDArray[np.float64], frequencies: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cosine and sine of each frequency, shape (b, m, 2)."""
    phase = 2.0 * np.pi * np.outer(at, frequencies)
    return np.stack([np.cos(phase), np.sin(phase)], axis=2)
