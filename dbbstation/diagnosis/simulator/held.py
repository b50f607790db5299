"""Held-out error of a simulator: omit rows, repeat the selection, simulate."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.fit import near
from dbbstation.diagnosis.simulator.nodes import noise_of, spread_of
from dbbstation.diagnosis.simulator.noise_left import noise_left
from dbbstation.diagnosis.simulator.search import compared_quickly, search
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.coloured import log_student
from dbbstation.inference.folds import Fold, KnownGains, beside, part_numbers
from dbbstation.inference.followed import VariableProbabilities, classes_of, followed_by
from dbbstation.inference.triangle import rms

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.diagnosis.simulator.nodes import Node, Nodes
    from dbbstation.diagnosis.simulator.search import SearchOutcome
    from dbbstation.diagnosis.simulator.work import FittedState, SimulationRuns
    from dbbstation.inference.channel import Channel
    from dbbstation.inference.settle import Settled


@dataclass(frozen=True)
class PredictedPart(Fold):
    """One held-out part, with gains of classes of signals.

    Attributes:
        where: its rows, shape (n,).
        of_classes: gain of log density, and rms error without the class, by its signals; the empty set is for all
            terms.
    """

    where: Flags = field(default_factory=lambda: np.zeros(0, dtype=bool))
    of_classes: Mapping[frozenset[str], tuple[float, float]] = field(default_factory=dict)


def gains_of(parts: Sequence[PredictedPart]) -> KnownGains:
    """Return the held-out gains of terms and classes."""
    counts = np.array([part.rows for part in parts], dtype=np.float64)

    def over_all(errors: Sequence[float]) -> float:
        return float(np.sqrt(counts @ np.square(errors) / counts.sum()))

    gains = [{**part.gains, **{key: gain for key, (gain, _) in part.of_classes.items()}} for part in parts]
    before = {key: over_all([part.of_classes[key][1] for part in parts]) for key in parts[0].of_classes}
    return KnownGains([part.where for part in parts], gains, before, over_all([part.after for part in parts]))


def parts(work: SimulationRuns) -> list[tuple[str, Flags]]:
    """Return parts, by `part_numbers` of the runs, with all outputs."""
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
) -> Iterator[PredictedPart]:
    """Predict each part, as far as the simulation budget permits."""
    as_simulated, every = nodes.work.residuals([stated])[0], parts(nodes.work)
    classes = [one.wanted for one in classes_of(found.settled, VariableProbabilities(found.settled))]
    for done, (name, rows) in enumerate(every):
        progress("held-out part", done, len(every))
        yield _predicted(nodes, base, found, as_simulated, classes, name, rows)


def _predicted(
    nodes: Nodes,
    base: Node,
    found: SearchOutcome,
    as_simulated: Floats,
    classes: Sequence[frozenset[str]],
    name: str,
    rows: Flags,
) -> PredictedPart:
    work, channel = nodes.work, found.node.channel
    out = rows | beside(channel, rows, found.settled.noise.correlation_samples)
    one = search(nodes, base, partial(_without, out=out, found=found), refits=False)
    _, refitted = near(work, base.fitted, lambda values: values[~out], max(base.size, 1e-300))
    others = channel.without(out)
    with_all = log_density(work, others, rows, one.residual, one.node.fitted.columns)

    @cache
    def brought(terms: frozenset[str]) -> tuple[float, float]:
        """Return the gain of log density by some terms, and the rms error without them."""
        if not terms:
            return 0.0, rms(one.residual[rows])
        less = one.node
        for term in sorted(terms):
            less = nodes.without(less, term)
        _, left = near(work, less.fitted, *noise_of(one.settled))
        return with_all - log_density(work, others, rows, left, less.fitted.columns), rms(left[rows])

    names, bank = one.node.names, one.settled.bank
    gains: dict[tuple[str, ...], float] = {(term,): brought(frozenset({term}))[0] for term in names}
    wanted = {own: frozenset(term for term in names if followed_by(bank, term) & own) for own in classes}
    of_classes = {own: brought(terms) for own, terms in {frozenset[str](): frozenset(names), **wanted}.items()}
    before, middle, after = (rms(values[rows]) for values in (as_simulated, refitted, one.residual))
    return PredictedPart(name, int(rows.sum()), before, middle, after, gains, rows, of_classes)


def _without(channel: Channel, out: Flags, found: SearchOutcome) -> Settled:
    """Return the comparison without rows, shape (n,)."""
    return compared_quickly(channel.without(out).thinned(BOUNDS.fold_rows), found.settled.beginning)


def log_density(
    work: SimulationRuns,
    channel: Channel,
    rows: Flags,
    residual: Floats,
    columns: Floats,
) -> float:
    """Return the log density of rows for a refit to other rows [Good 1952]; Student's t for long tails.

    Args:
        rows: predicted rows, shape (n,).
        columns: derivatives by fitted parameters, shape (n, m).
    """
    bank = noise_left(work, residual, columns, rows=channel)
    noise, spread = bank.noise, spread_of(work, bank)[work.output[rows]]
    whitening = noise.whitening(replace(channel, kept=rows, apart=1).stretches)

    def white(values: Floats) -> Floats:
        even = (values[rows].T / spread).T
        return (even if whitening is None else whitening @ even) / noise.innovation

    level = 0.0 if whitening is None else float(np.log(whitening.diagonal()).sum())
    level -= float(np.log(np.sqrt(2.0 * np.pi) * noise.innovation * spread).sum())
    left = white(residual)
    if np.isfinite(bank.tails):
        return level + float(np.sum(log_student(left, bank.tails)))
    own = bank.whitened(columns) / noise.innovation
    open_, norm = work.model.inverse_information(own, 1e-10)
    there = white(columns) / norm
    # The rows' covariance is one plus there @ open_ @ there.T; Woodbury's formula gives inverse and determinant.
    inner = np.eye(len(open_)) + open_ @ (there.T @ there)
    towards = there.T @ left
    squares = float(left @ left - towards @ np.linalg.solve(inner, open_ @ towards))
    return level - 0.5 * (squares + float(np.linalg.slogdet(inner)[1]))
