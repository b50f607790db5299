"""What is said of a comparison beside verdicts: where each cause acts, what a calibration would make of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit.calibrate import KINEMATIC_SOURCES
from dbbstation.inference.read_off import HALF
from dbbstation.inference.verdict import OUT
from dbbstation.sources.registry import sources_named

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.compare.pairs import Pair
    from dbbstation.diagnosis.compare.sides import Sides
    from dbbstation.inference.settled import Settled

RANK = 1e-9
"""Share of the largest singular value of the kinematic columns below which a direction says nothing."""


@dataclass(frozen=True)
class EffectOfCause:
    """What one cause of the most probable set does to the difference.

    Attributes:
        share: of the reduction of chi-square by all that was found, what it brings alone.
        taken_up: share of its sum of squares that a new kinematic calibration of B would take up.
        opposite: share of its sum of squares that changes its sign with the direction, over tests that were run in both.
        test: of the run in which it is largest.
        theta_deg: arc of that run, from and to, over which it is at least half as large as at its peak [deg].
    """

    rms_mm: float
    share: float
    taken_up: float
    opposite: float
    test: str
    direction: str
    theta_deg: tuple[float, float]
    peak_mm: float


def effects_of(sides: Sides, settled: Settled) -> dict[str, EffectOfCause]:
    """Effects of the causes of the most probable set, by name, those that are worth most beside the others first."""
    comparison, best = settled.comparison, settled.best
    kinematic = _kinematic(sides)
    found = {}
    for member in sorted(best.members, key=lambda m: -best.log_factor(m.cause.name)):
        name = member.cause.name
        rows = settled.effect([name])
        share = comparison.explained([member]) / comparison.explained(best.members)
        taken_up = float(np.sum((kinematic.T @ rows) ** 2) / max(float(rows @ rows), 1e-300))
        found[name] = _placed(sides, rows, min(share, 1.0), taken_up)
    return found


def _placed(sides: Sides, rows: NDArray[np.float64], share: float, taken_up: float) -> EffectOfCause:
    by_run = sides.by_angle(rows)
    worst = int(np.argmax([np.abs(values).max() for values in by_run]))
    pair, values = sides.pairs[worst], by_run[worst]
    at, count = int(np.argmax(np.abs(values))), len(values)
    inside = values * np.sign(values[at]) >= HALF * abs(values[at])
    # The arc about the peak, round the turn: no further than to where it ends on either side.
    rolled = np.roll(inside, -at)
    ahead = count if rolled.all() else int(np.argmin(rolled))
    back = 0 if rolled.all() else int(np.argmin(rolled[::-1]))
    step = 360.0 / count
    arc = ((at - back) * step % 360.0, ((at + ahead) * step - 1e-9) % 360.0)
    return EffectOfCause(
        float(np.sqrt(np.mean(rows**2))),
        share,
        taken_up,
        opposite_share(sides, by_run),
        pair.test,
        str(pair.direction),
        arc,
        float(values[at]),
    )


def opposite_share(sides: Sides, by_run: list[NDArray[np.float64]]) -> float:
    """Share of a sum of squares over tests that were run in both directions that changes its sign with the direction."""
    same, opposite = 0.0, 0.0
    for one, other in both_directions(sides.pairs):
        same += float(np.sum((by_run[one] + by_run[other]) ** 2))
        opposite += float(np.sum((by_run[one] - by_run[other]) ** 2))
    return opposite / (same + opposite) if same + opposite > 0.0 else 0.0


def both_directions(pairs: Sequence[Pair]) -> list[tuple[int, int]]:
    """Places of the runs of each test that was run in both directions."""
    by_test: dict[tuple[str, int], list[int]] = {}
    for k, pair in enumerate(pairs):
        by_test.setdefault((pair.test, pair.number), []).append(k)
    return [(runs[0], runs[1]) for runs in by_test.values() if len(runs) == 2]  # noqa: PLR2004


def _kinematic(sides: Sides) -> NDArray[np.float64]:
    """Orthonormal columns of what the kinematic parameters of the machine can do to the readings of B, shape (n, k)."""
    sources = sources_named(KINEMATIC_SOURCES)
    columns = [
        np.hstack([reading.by_source(s, sides.machine, np.zeros(len(s.parameters(sides.machine)))) for s in sources])
        for reading in sides.readings[1]
    ]
    axes, sizes, _ = np.linalg.svd(sides.averaged(1, columns), full_matrices=False)
    return np.asarray(axes[:, sizes > RANK * sizes[0]], dtype=np.float64)


def noticed_mm(settled: Settled) -> float:
    """Change of the length of the strut that is seen worst that would stand out [mm]."""
    cause = next(cause for cause in settled.causes if cause.name == "strut-reference-length")
    single = [v.columns for v in cause.variants if len(v.columns) == 1 and v.label.startswith("strut")]
    products = [float(settled.comparison.beside((), columns)[0, 0]) for columns in single]
    return OUT / float(np.sqrt(max(min(products), 1e-300)))
