"""Pulses and steps of a force in time, as levels between the edges that were found."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.findings import Part
from dbbstation.diagnosis.drive.fit import fit
from dbbstation.inference.curves import Stretches
from dbbstation.inference.verdict import Value

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.drive.explain import Explained

APART = 4.0
"""Standard uncertainties by which levels of a force in time must differ to be two: one in 15,000 by chance."""


def pulse_parts(explained: Explained, names: Sequence[str]) -> list[Part]:
    """Stretches of time in which the force differs from what it is before and behind them, or from what it is most of the time.

    Stretches that were found may overlap; what they are together has levels, of which neighbours that do not differ by
    `APART` standard uncertainties are one.

    Args:
        explained: the comparison.
        names: of members of the best hypothesis that are stretches of time.
    """
    # Neighbouring levels have most of their uncertainty in common, which factors for each of them would not know.
    settled, recordings = explained.settled, explained.drive.recordings
    after, apart, times = (
        fit(explained.drive, settled, settled.best.members),
        recordings.samples_apart_s,
        recordings.time_s,
    )
    columns, ends = [], []
    for name in names:
        rows, form = after.columns_of(name), settled.bank.patterns[name].form
        if isinstance(form, Stretches):
            columns.append(np.arange(rows.start, rows.stop))
            ends.append(np.column_stack([form.first, form.last])[: rows.stop - rows.start] * apart)
    own, within = np.concatenate(columns), np.clip(np.vstack(ends), times[0], times[-1])
    values, covariance = after.values[own], after.covariance[np.ix_(own, own)]

    def size(less: NDArray[np.float64]) -> Value:
        return Value(float(less @ values), float(np.sqrt(max(float(less @ covariance @ less), 1e-300))), "N")

    def differ(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
        found = size(one - other)
        return abs(found.value) > APART * found.uncertainty

    def part(first: float, last: float, less: NDArray[np.float64]) -> Part:
        return Part("", {"force_n": size(less), "duration_s": Value(last - first, apart, "s")}, (first, last))

    edges = _told_apart(np.concatenate([times[[0, -1]], within.ravel()]), apart)
    levels: list[tuple[float, float, NDArray[np.float64]]] = []
    for first, last in pairwise(edges):
        middle = 0.5 * (first + last)
        level = ((within[:, 0] < middle) & (within[:, 1] > middle)).astype(np.float64)
        begins = first
        if levels and not differ(level, levels[-1][2]):
            begins, _, before = levels.pop()
            share = (last - first) / (last - begins)
            level = share * level + (1.0 - share) * before
        levels.append((begins, last, level))
    found = []
    while (peak := _peak(levels, values, differ)) is not None:
        found.append(part(*peak))
    levels.sort(key=lambda one: float(one[2] @ values))
    lasts = np.cumsum([last - first for first, last, _ in levels])
    usual = levels[int(np.searchsorted(lasts, 0.5 * lasts[-1]))][2]
    found += [part(first, last, level - usual) for first, last, level in levels if differ(level, usual)]
    return sorted(found, key=lambda one: one.t_s or ())


def _peak(
    levels: list[tuple[float, float, NDArray[np.float64]]],
    values: NDArray[np.float64],
    differ: Callable[[NDArray[np.float64], NDArray[np.float64]], bool],
) -> tuple[float, float, NDArray[np.float64]] | None:
    """The shortest level that stands out of those before and behind it, and by what; these two are made one. None where none does.

    What happens slowly in time beside it, a load or a curve, does not matter then.
    """
    found: list[tuple[float, int]] = []
    for k in range(1, len(levels) - 1):
        before, own, behind = (level for *_, level in levels[k - 1 : k + 2])
        sizes = float((own - before) @ values), float((own - behind) @ values)
        if sizes[0] * sizes[1] > 0.0 and differ(own, before) and differ(own, behind):
            found.append((levels[k][1] - levels[k][0], k))
    if not found:
        return None
    _, k = min(found)
    (begins, _, before), (first, last, own), (_, ends, behind) = levels[k - 1 : k + 2]
    share = (first - begins) / (first - begins + ends - last)
    around = share * before + (1.0 - share) * behind
    levels[k - 1 : k + 2] = [(begins, ends, around)]
    return first, last, own - around


def _told_apart(times: NDArray[np.float64], apart: float) -> list[float]:
    """Times, rising, of which those that are closer together than the band tells apart are one, at their mean."""
    rising = np.sort(times)
    return [float(part.mean()) for part in np.split(rising, np.flatnonzero(np.diff(rising) > apart) + 1)]
