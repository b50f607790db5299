"""Long runs as a few hundred nodes, without loss.

A reading that depends on pose and time is smooth along the circle. Within six degrees it and its derivatives are
polynomials of degree five to parts in 1e8, given at six nodes. With W from nodes to samples, J = W Jn, and W = Q R by
sector, J^T J and J^T residual of the samples are those of R Jn and Q^T residual. Estimates, covariance and sum of
squares are exactly the samples'. See docs/decisions.md, 2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.blocks import compress
from dbbstation.plan.circle import FULL_TURN_DEG

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.inference.blocks import Block
    from dbbstation.model.observation import Observation

SECTORS = 60
"""Sectors of a turn, six degrees each."""

AT_ONCE = 6
"""Sectors that are worked out together; a divisor of their number."""

PER_SECTOR = 6
"""Nodes of a sector, at the zeros of Chebyshev's polynomial."""

LONG = 4
"""Samples per node from which nodes are less work."""

SMOOTH = 1e-6
"""Greatest share of the last Chebyshev coefficient in a smooth quantity. The next, which is what the nodes miss, is a
hundred times smaller where the quantity goes with the circle's first harmonics; a step leaves a tenth of itself."""

NOTHING = 1e-9
"""Size of what cannot be told from zero: a picometre in a reading, or the effect of a millimetre by so much."""

_ANGLES = (np.arange(PER_SECTOR) + 0.5) * np.pi / PER_SECTOR
_PLACES = -np.cos(_ANGLES)
"""Nodes within a sector that reaches from -1 to 1, rising."""

_WEIGHTS = (-1.0) ** np.arange(PER_SECTOR) * np.sin(_ANGLES)
"""Of the barycentric formula [Berrut and Trefethen, SIAM Review 46 (2004) 501, eq 5.3]."""

_TO_POWERS = np.linalg.inv(np.vander(_PLACES, increasing=True))
"""Values at the nodes to coefficients of powers of the place, lowest first; the condition is that of six nodes, a hundred."""

_LAST = 2.0 / PER_SECTOR * np.cos((PER_SECTOR - 1) * np.arccos(_PLACES))
"""Values at the nodes times this: the last Chebyshev coefficient."""


@dataclass(frozen=True, eq=False)
class RunNodes:
    """A run and its nodes.

    Attributes:
        coarse: the run with nodes as samples; its lengths are meaningless.
        roots: R of each sector, shape (sectors, nodes, nodes).
        seen: Q^T of measured less nominal length, shape (sectors, nodes) [mm].
        unseen: norm of the residual beyond smooth readings [mm].
    """

    run: Observation
    coarse: Observation
    roots: Floats
    seen: Floats
    unseen: float

    def samples_of(self, values: Floats) -> Floats:
        """Return values at all samples, shape (n,), from those at the nodes, shape (m,)."""
        sector, place = _in_sectors(self.run.raw.phi_deg)
        powers = values.reshape(SECTORS, PER_SECTOR) @ _TO_POWERS.T
        found = powers[sector, -1]
        for power in powers.T[-2::-1]:
            found *= place
            found += power[sector]
        return found

    def compressed(
        self,
        columns: Integers,
        jacobian: Floats,
        length_mm: Floats,
        shift: Floats,
    ) -> Block:
        """Compress the run's samples.

        Args:
            columns: shape (k,).
            jacobian: at the nodes, shape (m, k).
            shift: jacobian times this is added to measured less predicted length, shape (k,).
        """
        nominal = self.run.raw.circle.bar_mm
        rows = self.roots @ jacobian.reshape(SECTORS, PER_SECTOR, -1)
        explained = self.roots @ (length_mm - nominal).reshape(SECTORS, PER_SECTOR, 1)
        flat = rows.reshape(SECTORS * PER_SECTOR, -1)
        target = self.seen.ravel() - explained.ravel() + flat @ shift
        block = compress(columns, np.vstack([flat, np.zeros(flat.shape[1])]), np.append(target, self.unseen))
        return replace(block, count=len(self.run.raw))


def nodes_of(run: Observation) -> RunNodes | None:
    """Return a run's nodes; None for short runs and those commanded by samples."""
    raw = run.raw
    if len(raw) < LONG * SECTORS * PER_SECTOR or run.commanded is not None:
        return None
    sector, within = _in_sectors(raw.phi_deg)
    phi = (np.arange(SECTORS)[:, None] + (1.0 + _PLACES) / 2.0).ravel() * (FULL_TURN_DEG / SECTORS)
    order = np.argsort(raw.phi_deg, kind="stable")
    nodes = replace(
        raw,
        phi_deg=phi,
        t_s=np.interp(phi, raw.phi_deg[order], raw.t_s[order]),
        length_mm=np.full(len(phi), raw.circle.bar_mm),
        logged={},
    )
    count = np.bincount(sector, minlength=SECTORS)
    most = max(int(count.max()), PER_SECTOR + 1)
    ends = np.concatenate([[0], np.cumsum(count)])
    triangle = np.empty((SECTORS, PER_SECTOR + 1, PER_SECTOR + 1))
    # Some sectors at a time: weights of all nodes at all samples would take several times what the recording takes.
    for begin in range(0, SECTORS, AT_ONCE):
        some = order[ends[begin] : ends[begin + AT_ONCE]]
        own = sector[some]
        system = np.zeros((AT_ONCE, most, PER_SECTOR + 1))
        place = own - begin, np.arange(len(some)) - (ends[own] - ends[begin])
        system[(*place, slice(0, PER_SECTOR))] = _interpolation(within[some])
        system[(*place, PER_SECTOR)] = raw.length_mm[some] - raw.circle.bar_mm
        triangle[begin : begin + AT_ONCE] = np.linalg.qr(system, mode="r")
    return RunNodes(
        run=run,
        coarse=replace(run, raw=nodes),
        roots=np.ascontiguousarray(triangle[:, :-1, :-1]),
        seen=np.ascontiguousarray(triangle[:, :-1, -1]),
        unseen=float(np.linalg.norm(triangle[:, -1, -1])),
    )


def _in_sectors(phi_deg: Floats) -> tuple[Integers, Floats]:
    place = phi_deg * (SECTORS / FULL_TURN_DEG)
    sector = np.clip(place.astype(np.int64), 0, SECTORS - 1)
    return sector, 2.0 * (place - sector) - 1.0


def smooth(values: Floats) -> bool:
    """Return whether quantities at nodes, shape (m, k), are polynomials that join between sectors.

    Deviations below a billionth are rounding.
    """
    by_sector = values.reshape(SECTORS, PER_SECTOR, -1)
    last = np.abs(np.einsum("p,spk->sk", _LAST, by_sector)).max(axis=0)
    # A step between the outermost nodes of two neighbours shows in neither of them.
    begin, end = np.einsum("ep,spk->esk", _interpolation(np.array([-1.0, 1.0])), by_sector)
    step = np.abs(begin[1:] - end[:-1]).max(axis=0)
    return bool(np.all(np.maximum(last, step) <= SMOOTH * np.abs(values).max(axis=0) + NOTHING))


def _interpolation(place: Floats) -> Floats:
    """Return the polynomials that are one at one node, at places from -1 to 1, shape (n, nodes)."""
    distance = place[:, None] - _PLACES
    exact = distance == 0.0
    terms = _WEIGHTS / np.where(exact, 1.0, distance)
    values: Floats = terms / terms.sum(axis=1, keepdims=True)
    on_node = exact.any(axis=1)
    values[on_node] = exact[on_node]
    return values
