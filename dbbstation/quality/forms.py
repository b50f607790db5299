"""Forms of runs that share causes, as few numbers whatever the number of runs.

Each place's own part of the covariance (noise, seat) is whitened. An orthogonal transformation leaves as many rows as
causes and keeps likelihoods [Bierman, Factorization Methods for Discrete Sequential Estimation (1977), ch. V].
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.quality.knowledge import COEFFICIENTS, HIGHEST_HARMONIC, along_travel
from dbbstation.quality.stated import unseen_um2

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from dbbstation.quality.knowledge import Seen

SIZES = np.geomspace(0.03, 3.0, 9)
"""Errors of a machine as shares of their usual or stated size: from one calibrated to hundredths of a millimetre to one put together
without care."""

FIRST_COSINE, FIRST_SINE = 1, HIGHEST_HARMONIC + 1
"""Coefficients of one undulation, which a shift of the circle makes."""

ANYWHERE_UM = 1e4
"""Standard deviation of the centre of a circle whose ball was put up under the spindle: it says nothing [µm]."""


LEAST_UM2 = 1e-12
"""Variance below which no coefficient is known, a picometre squared: recordings without noise are white, too [µm²]."""

UNMOVED = 1e-5
"""A row that causes of usual size move by less than this share of its noise has noise alone: a likelihood changes by 1e-9 of itself."""


@dataclass(frozen=True, eq=False)
class Forms:
    """Whitened forms of runs along their travel, and effects of causes.

    Attributes:
        machine: effects of machine causes at usual or stated size, shape (r, p).
        rest: other shared effects, shape (r, q).
        off: forms less expectation, shape (r, k).
        log_determinant: of the own covariance before whitening.
        dimensions: coefficients of each test.
        root: from rows of one place to coefficients, shape (r, r) [µm]; empty for several.
    """

    machine: NDArray[np.float64]
    rest: NDArray[np.float64]
    off: NDArray[np.float64]
    log_determinant: float
    tests: tuple[str, ...]
    dimensions: Mapping[str, int]
    root: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))

    def apart(self) -> Independent:
        """Return an orthogonal transformation to as many rows as causes and columns, with separate causes."""
        p, q = self.machine.shape[1], self.rest.shape[1]
        few = np.hstack([self.machine, self.rest, self.off])
        if len(few) > few.shape[1]:
            few = np.asarray(np.linalg.qr(few, mode="r"), dtype=np.float64)
        axes, grown = _whitening(few[:, p : p + q])
        few = axes.T @ few / grown[:, None]
        # Rounding leaves 1e-16 of the largest variance, which is some 1e6 times that of noise, beside which all count.
        variance, axes = np.linalg.eigh(few[:, :p] @ few[:, :p].T)
        few, variance = axes.T @ few, np.maximum(variance, 0.0)
        log_determinant = self.log_determinant + 2.0 * float(np.sum(np.log(grown)))
        return Independent(few[:, :p], few[:, p : p + q], few[:, p + q :], variance, log_determinant)


@dataclass(frozen=True, eq=False)
class Independent:
    """Rows that are independent for any size of machine errors.

    Attributes:
        machine: effects of machine causes at usual or stated size, shape (r, p).
        rest: other shared effects, shape (r, q).
        off: forms less expectation, shape (r, k).
        variance: by machine causes, beside one by all else, shape (r,).
    """

    machine: NDArray[np.float64]
    rest: NDArray[np.float64]
    off: NDArray[np.float64]
    variance: NDArray[np.float64]
    log_determinant: float

    def variances(self, size: float | NDArray[np.float64]) -> NDArray[np.float64]:
        """Return row variances at a multiple of usual machine errors, shape (r,)."""
        return 1.0 + size**2 * self.variance

    def log_likelihoods(self) -> NDArray[np.float64]:
        """Return each column's log density by each of SIZES, shape (9, k), without a constant."""
        variances = self.variances(SIZES[:, None])
        squares: NDArray[np.float64] = (1.0 / variances) @ self.off**2
        return -0.5 * (squares + np.sum(np.log(variances), axis=1)[:, None] + self.log_determinant)


def _whitening(shared: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return axes with unit variance and shared causes, and standard deviations along them."""
    axes, sizes, _ = np.linalg.svd(shared)
    return axes, np.sqrt(1.0 + np.pad(sizes, (0, len(axes) - len(sizes))) ** 2)


def stacked(forms: Sequence[Forms]) -> Forms:
    """Return stacked rows, for one test no more than causes distinguish."""
    of_test: dict[tuple[str, ...], list[Forms]] = {}
    for each in forms:
        of_test.setdefault(tuple(each.dimensions), []).append(each)
    return _above([_repeated(_above(each)) if len(each) > 1 else each[0] for each in of_test.values()])


def _above(forms: Sequence[Forms]) -> Forms:
    return Forms(
        np.vstack([each.machine for each in forms]),
        np.vstack([each.rest for each in forms]),
        np.vstack([each.off for each in forms]),
        sum(each.log_determinant for each in forms),
        tuple(test for each in forms for test in each.tests),
        {test: sum(each.dimensions.get(test, 0) for each in forms) for each in forms for test in each.dimensions},
    )


def _repeated(forms: Forms) -> Forms:
    """Return repeats in rows that causes move, and one row of noise per column."""
    p, q = forms.machine.shape[1], forms.rest.shape[1]
    together = np.hstack([forms.machine, forms.rest])
    axes, sizes, _ = np.linalg.svd(together, full_matrices=len(together) > p + q)
    moved = int(np.count_nonzero(sizes > UNMOVED))
    rows = axes.T @ np.hstack([together, forms.off])
    still = np.linalg.qr(rows[moved:, p + q :], mode="r")
    kept = np.vstack([rows[:moved], np.hstack([np.zeros((len(still), p + q)), still])])
    tests = (forms.tests[0],) * len(kept)
    return Forms(kept[:, :p], kept[:, p : p + q], kept[:, p + q :], forms.log_determinant, tests, forms.dimensions)


def by_place(runs: Sequence[Seen], off_um: Sequence[NDArray[np.float64]]) -> list[Forms]:
    """Return the forms by place: one test on one mounting.

    Args:
        runs: n, with known places.
        off_um: forms along the travel less expectation, shape (7, k) each.
    """
    effects = [_effects(each) for each in runs]
    places: dict[tuple[str, str], list[int]] = {}
    holders: dict[tuple[str, str], set[tuple[str, str]]] = {}
    for k, each in enumerate(runs):
        place = each.run.test, each.run.mounting
        places.setdefault(place, []).append(k)
        for key in effects[k]:
            holders.setdefault(key, set()).add(place)
    width = {key: effect.shape[1] for each in effects for key, effect in each.items()}

    def columns(rows: Sequence[int], keys: Sequence[tuple[str, str]]) -> NDArray[np.float64]:
        wide = [[effects[k].get(key, np.zeros((COEFFICIENTS, width[key]))) for key in keys] for k in rows]
        return np.vstack([np.hstack([np.zeros((COEFFICIENTS, 0)), *each]) for each in wide])

    machine = [key for key in holders if not key[1]]
    shared = [key for key, where in holders.items() if key[1] and len(where) > 1]
    # What the overlaps show of a drift may have gone on through the session.
    rate = float(np.sqrt(np.mean([each.drift_um_s**2 for each in runs])))
    found = []
    for place, rows in places.items():
        alone = columns(rows, [key for key, where in holders.items() if key[1] and where == {place}])
        drift = np.concatenate([rate * (runs[k].run.started_s or 0.0) * np.eye(COEFFICIENTS)[0] for k in rows])
        rest = np.column_stack([columns(rows, shared), drift])
        off = np.concatenate([off_um[k] for k in rows])
        sigma = np.sqrt(np.concatenate([own_um2(runs[k]) for k in rows]))
        axes, grown = _whitening(alone / sigma[:, None])
        white = axes.T / grown[:, None] / sigma
        found.append(
            Forms(
                white @ columns(rows, machine),
                white @ rest,
                white @ off,
                2.0 * float(np.sum(np.log(sigma)) + np.sum(np.log(grown))),
                (place[0],) * len(sigma),
                {place[0]: len(sigma)},
                sigma[:, None] * axes * grown,
            )
        )
    return found


def own_um2(one: Seen) -> NDArray[np.float64]:
    """Return each coefficient's own variance, shape (7,) [µm²]."""
    own = np.full(COEFFICIENTS, max(0.5 * unseen_um2(one, one), LEAST_UM2))
    if one.run.expected is not None and not one.run.expected.place_known:
        own[[FIRST_COSINE, FIRST_SINE]] += ANYWHERE_UM**2
    return own


def _effects(one: Seen) -> dict[tuple[str, str], NDArray[np.float64]]:
    signs = along_travel(one.run.circle)
    effects = {} if one.run.expected is None else one.run.expected.effects_um
    return {key: signs[:, None] * effect for key, effect in effects.items()}
