"""Details of found effects: place, and absorption by calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit.calibrate import KINEMATIC_SOURCES
from dbbstation.diagnosis.compare.findings import EffectOfCause, LargestEffect
from dbbstation.inference.read_off import HALF
from dbbstation.inference.triangle import RANK, rms
from dbbstation.inference.verdict import OUT
from dbbstation.sources.registry import sources_named

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.compare.pairs import Pair
    from dbbstation.diagnosis.compare.sides import Sides
    from dbbstation.inference.settled import Settled


def effects_of(sides: Sides, settled: Settled) -> dict[str, EffectOfCause]:
    """Return effects of the best set by name, largest evidence first."""
    comparison, best = settled.comparison, settled.best
    kinematic = _kinematic(sides)
    found = {}
    for member in sorted(best.members, key=lambda m: -best.log_factor(m.name)):
        name = member.name
        rows = settled.effect([name])
        share = comparison.explained([member]) / comparison.explained(best.members)
        taken_up = float(np.sum((kinematic.T @ rows) ** 2) / max(float(rows @ rows), 1e-300))
        found[name] = _placed(sides, rows, min(share, 1.0), taken_up)
    return found


def _placed(sides: Sides, rows: Floats, share: float, taken_up: float) -> EffectOfCause:
    by_run = sides.by_angle(rows)
    worst = int(np.argmax([np.abs(values).max() for values in by_run]))
    pair, values = sides.pairs[worst], by_run[worst]
    at, count = int(np.argmax(np.abs(values))), len(values)
    inside = values * np.sign(values[at]) >= HALF * abs(values[at])
    # The contiguous arc about the peak, across the turn's start.
    rolled = np.roll(inside, -at)
    ahead = count if rolled.all() else int(np.argmin(rolled))
    back = 0 if rolled.all() else int(np.argmin(rolled[::-1]))
    step = 360.0 / count
    first, last = (at - back) * step % 360.0, ((at + ahead) * step - 1e-9) % 360.0
    peak_um, run = 1e3 * float(values[at]), f"{pair.test} {pair.direction}"
    text = f"up to {peak_um:+.1f} µm in test {run}, {first:.0f} to {last:.0f} degrees"
    where = LargestEffect(pair.test, str(pair.direction), (first, last), peak_um, text)
    return EffectOfCause(1e3 * rms(rows), share, taken_up, opposite_share(sides, by_run), where)


def opposite_share(sides: Sides, by_run: list[Floats]) -> float:
    """Return the share of squares that change sign with direction."""
    same, opposite = 0.0, 0.0
    for one, other in both_directions(sides.pairs):
        same += float(np.sum((by_run[one] + by_run[other]) ** 2))
        opposite += float(np.sum((by_run[one] - by_run[other]) ** 2))
    return opposite / (same + opposite) if same + opposite > 0.0 else 0.0


def both_directions(pairs: Sequence[Pair]) -> list[tuple[int, int]]:
    """Return the runs of tests measured in both directions."""
    by_test: dict[tuple[str, int], list[int]] = {}
    for k, pair in enumerate(pairs):
        by_test.setdefault((pair.test, pair.number), []).append(k)
    return [(runs[0], runs[1]) for runs in by_test.values() if len(runs) == 2]  # noqa: PLR2004


def _kinematic(sides: Sides) -> Floats:
    """Return an orthonormal basis of kinematic effects on B's readings, shape (n, k)."""
    sources = sources_named(KINEMATIC_SOURCES)
    columns = [
        np.hstack([reading.by_source(s, sides.machine, np.zeros(len(s.parameters(sides.machine)))) for s in sources])
        for reading in sides.readings[1]
    ]
    axes, sizes, _ = np.linalg.svd(sides.averaged(1, columns), full_matrices=False)
    return axes[:, sizes > RANK * sizes[0]]


def noticed_mm(settled: Settled) -> float:
    """Return the detectable change of length for the least visible strut [mm]."""
    cause = next(cause for cause in settled.causes if cause.name == "strut-reference-length")
    single = [v.columns for v in cause.variants if len(v.columns) == 1 and v.label.startswith("strut")]
    products = [float(settled.comparison.beside((), columns)[0, 0]) for columns in single]
    return OUT / float(np.sqrt(max(min(products), 1e-300)))
