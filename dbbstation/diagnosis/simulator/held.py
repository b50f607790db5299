"""Held-out error of a simulator: parts are left out, terms are chosen anew, and the whole is simulated again.

A part is predicted by a simulation that runs through it: the state at its beginning is simulated, too. Linear answers are those about
refits to all rows; values that predict come from the other rows alone.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.density import log_density
from dbbstation.diagnosis.simulator.fit import near
from dbbstation.diagnosis.simulator.nodes import noise_of
from dbbstation.diagnosis.simulator.search import compared_quickly, search
from dbbstation.diagnosis.simulator.work import rms
from dbbstation.diagnosis.table.mismatch import FOLD_ROWS
from dbbstation.inference.folds import Fold, HeldOutError, beside, part_numbers
from dbbstation.inference.verdict import DensityGains

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator

    from numpy.typing import NDArray

    from dbbstation.diagnosis.simulator.nodes import Node, Nodes
    from dbbstation.diagnosis.simulator.search import SearchOutcome
    from dbbstation.diagnosis.simulator.work import FittedState, SimulationRuns
    from dbbstation.inference.channel import Channel
    from dbbstation.inference.folds import Kind
    from dbbstation.inference.settled import Settled


class PredictedPartsError(HeldOutError):
    """Parts that were held back, and what each term brought there as log density of the prediction."""

    def gains_of(self, kinds: Collection[Kind]) -> DensityGains:
        """What terms brought together in each part; nothing where none of them was chosen."""
        gains = super().gains_of(kinds)
        return DensityGains(gains.parts, gains.rows)


def parts(work: SimulationRuns) -> list[tuple[str, NDArray[np.bool_]]]:
    """Parts that are held back [`part_numbers` of the runs], all outputs together."""
    runs, outputs = work.model.runs, len(work.model.outputs)
    number = part_numbers([len(run) for run in runs])
    of_run = np.split(number, np.cumsum([len(run) for run in runs])[:-1])
    found = []
    for part in range(int(number.max()) + 1):
        rows, said = np.zeros(work.size, dtype=bool), []
        for k, (run, own) in enumerate(zip(runs, of_run, strict=True)):
            inside = np.flatnonzero(own == part)
            if not len(inside):
                continue
            ends = run.inputs["t"][inside[[0, -1]]]
            whole = len(inside) == len(own)
            said.append(run.name if whole else f"{run.name} from {ends[0]:.4g} to {ends[1]:.4g} s")
            for block in work.blocks[k * outputs : (k + 1) * outputs]:
                rows[block.start + inside] = True
        found.append((", ".join(said), rows))
    return found


def predicted_parts(
    nodes: Nodes, base: Node, found: SearchOutcome, stated: FittedState, progress: Callable[[str, int, int], None]
) -> Iterator[Fold]:
    """Hold parts back in turn; choose terms anew, refit, simulate; one after the other, since simulations may be spent.

    Args:
        nodes: that were visited.
        base: the simulator as it is, refitted.
        found: what all rows came to.
        stated: parameters as the model states them, which are the reference.
        progress: called with what is being done, and how much of how much.
    """
    work, channel = nodes.work, found.node.channel
    as_simulated = work.residuals([stated])[0]
    every = parts(work)
    for done, (name, rows) in enumerate(every):
        progress("held-out part", done, len(every))
        out = rows | beside(channel, rows, found.settled.noise.correlation_samples)

        one = search(nodes, base, partial(_without, out=out, found=found), refits=False)
        weigh, sigma = noise_of(one.settled)
        _, refitted = near(work, base.fitted, lambda r, out=out: r[~out], max(base.size, 1e-300))  # type: ignore[misc]  # bound now
        others = channel.without(out)
        with_all = log_density(work, others, rows, one.residual, one.node.fitted.columns)
        gains: dict[tuple[str, ...], float] = {}
        for term in one.node.names:
            less = nodes.without(one.node, term)
            _, left = near(work, less.fitted, weigh, sigma)
            gains[(term,)] = with_all - log_density(work, others, rows, left, less.fitted.columns)
        before, middle, after = (rms(values[rows]) for values in (as_simulated, refitted, one.residual))
        yield Fold(name, int(rows.sum()), before, middle, after, gains)


def _without(channel: Channel, out: NDArray[np.bool_], found: SearchOutcome) -> Settled:
    """Comparison without some rows, shape (n,)."""
    return compared_quickly(channel.without(out).thinned(FOLD_ROWS), found.settled.beginning)
