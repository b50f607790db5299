"""What each named cause brings in tests that took no part in choosing it.

Tests are held back in groups. Without each group the set of causes is chosen anew, from all that is listed, about the joint fit of all
tests: places of waves, bumps and steps, and nonlinear parameters to within half a step of their grid, are those of all tests. Then the
group is predicted with what was chosen, and with that but for one cause, base and other causes fitted anew without it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit.calibrate import SMALLEST_NOISE_MM
from dbbstation.diagnosis.explain import MOST_MEMBERS
from dbbstation.diagnosis.left_out import groups_of
from dbbstation.inference.hypotheses import search
from dbbstation.inference.square_root import free_directions
from dbbstation.inference.verdict import Gains, is_worse

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.explain import Explained
    from dbbstation.inference.model_comparison import Member

LEAST_GROUPS = 4
"""Groups of tests from which on a gain in seven tenths of them is more than chance."""


@dataclass(frozen=True, eq=False)
class ChosenAnew:
    """What was found when groups of tests were held back in turn.

    Attributes:
        brought: by name, in each group, what a cause brought: sum of squares of the prediction without it less that with it, in units of
            the noise; not given where it was not chosen.
        squares: in each group, sums of squares of the prediction by the kinematic calibration, and by what was chosen, shape (g, 2).
    """

    brought: tuple[dict[str, float], ...]
    squares: NDArray[np.float64]

    def gains(self, names: Iterable[str]) -> Gains:
        """Of causes that nothing measured here tells apart: what any of them brought in each group."""
        wanted = tuple(names)
        return Gains(tuple(sum(one.get(name, 0.0) for name in wanted) for one in self.brought))

    @property
    def worse(self) -> bool:
        """Whether what was chosen predicts worse than the kinematic calibration does."""
        calibration, chosen = np.sqrt(self.squares.sum(axis=0))
        return is_worse(float(chosen), float(calibration))


def chosen_anew(explained: Explained) -> ChosenAnew | None:
    """Hold back groups of tests in turn; None where there are too few, or where no cause was named."""
    settled, channel = explained.settled, explained.channel
    groups = np.array(groups_of(channel.observations))
    if not settled.members or len(set(groups.tolist())) < LEAST_GROUPS:
        return None
    target = channel.target(settled.after)
    noise_mm = max(settled.noise_mm, SMALLEST_NOISE_MM)
    brought, squares = [], []
    for group in sorted(set(groups.tolist())):
        out = np.zeros(len(target), dtype=bool)
        for rows, own in zip(channel.runs, groups, strict=True):
            out[rows] = own == group
        comparison = channel.beside_base(noise_mm, settled.scatter, but_for=out).comparison(np.where(out, 0.0, target))
        chosen = search(comparison, settled.causes, [settled.best.members], most_members=MOST_MEMBERS).best.members
        sets = [(), chosen, *([o for o in chosen if o is not m] for m in chosen if m.cause.named)]
        effects = [
            _effect(explained, some, comparison.estimates(some).values) if some else 0.0 * target for some in sets
        ]
        left = _left(explained, target[:, None] - np.column_stack(effects), out, noise_mm)
        names = [m.cause.name for m in chosen if m.cause.named]
        brought.append(dict(zip(names, (left[2:] - left[1]).tolist(), strict=True)))
        squares.append(left[:2])
    return ChosenAnew(tuple(brought), np.array(squares))


def _effect(explained: Explained, members: Sequence[Member], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """What members do to all readings, their slack with them, shape (n,)."""
    columns = np.concatenate([member.columns for member in members])
    return np.asarray(explained.channel.columns.samples[:, columns] @ values)


def _left(
    explained: Explained, targets: NDArray[np.float64], out: NDArray[np.bool_], noise_mm: float
) -> NDArray[np.float64]:
    """Weighted sums of squares that the base leaves of rows held back, fitted to the others, shape (m,).

    What only the rows held back know, such as where their balls came to stand, settles there under its prior, which counts.

    Args:
        explained: whose base.
        targets: less the effects of causes, shape (n, m).
        out: rows that are held back, shape (n,).
        noise_mm: of one sample [mm].
    """
    channel = explained.channel
    known, samples = channel.base, channel.columns.base
    random, fitted = np.flatnonzero(known.random), np.flatnonzero(~known.random)
    free = free_directions(known, fitted, channel.held)
    columns = np.hstack([samples[:, random] * known.prior[random], samples[:, fitted] @ free]) / noise_mm
    count, own = columns.shape[1], len(random)
    rows = np.vstack(
        [
            np.hstack([columns[~out], targets[~out] / noise_mm]),
            np.eye(own, count + targets.shape[1]),
        ]
    )
    triangle = np.asarray(np.linalg.qr(rows, mode="r"), dtype=np.float64)
    values = np.linalg.lstsq(triangle[:count, :count], triangle[:count, count:], rcond=None)[0]
    remaining = targets[out] / noise_mm - columns[out][:, own:] @ values[own:]
    axes = np.linalg.qr(np.vstack([columns[out][:, :own], np.eye(own)]))[0][: len(remaining)]
    return np.asarray(np.sum(remaining**2, axis=0) - np.sum((axes.T @ remaining) ** 2, axis=0))
