"""Reduce long runs to a few hundred nodes without loss of information.

A reading that depends on pose and time is smooth along the circle. Within six degrees, polynomials of degree five
represent it and its derivatives to parts in 1e8, from values at six nodes. W interpolates from nodes to samples: J = W
Jn. With W = Q R per sector, R Jn and Q^T residual give the same J^T J and J^T residual. Estimates, covariance and sum
of squares are therefore equal. See docs/decisions.md, 2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import norm_of
from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.inference.square_root import compress

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.inference.square_root import Block
    from dbbstation.model.observation import Observation

SECTORS = 60
"""Sectors of a turn, six degrees each."""

AT_ONCE = 6
"""Sectors computed together; a divisor of their number."""

PER_SECTOR = 6
"""Nodes per sector, at the zeros of the Chebyshev polynomial."""

LONG = 4
"""Fewest samples per node that make nodes faster."""

SMOOTH = 1e-6
"""Largest relative size of the last Chebyshev coefficient of a smooth quantity. For the circle's first harmonics the
next coefficient, the interpolation error, is a hundred times smaller. A step gives a tenth of its height."""

NOTHING = 1e-9
"""Negligible size: a picometre in a reading, or its equivalent per millimetre in a derivative."""

_ANGLES = (np.arange(PER_SECTOR) + 0.5) * np.pi / PER_SECTOR
_PLACES = -np.cos(_ANGLES)
"""Nodes within a sector from -1 to 1, in ascending order."""

_WEIGHTS = (-1.0) ** np.arange(PER_SECTOR) * np.sin(_ANGLES)
"""Weights of the barycentric formula [Berrut and Trefethen, SIAM Review 46 (2004) 501, eq 5.3]."""

_TO_POWERS = np.linalg.inv(np.vander(_PLACES, increasing=True))
"""Matrix from values at the nodes to polynomial coefficients, lowest power first; its condition number is a hundred."""

_LAST = 2.0 / PER_SECTOR * np.cos((PER_SECTOR - 1) * np.arccos(_PLACES))
"""Weights of the values at the nodes in the last Chebyshev coefficient."""


@dataclass(frozen=True, eq=False)
class RunNodes:
    """A run reduced to nodes.

    Attributes:
        coarse: the run with nodes as samples; its lengths are meaningless.
        roots: R of each sector, shape (sectors, nodes, nodes).
        seen: Q^T of measured less nominal length, shape (sectors, nodes) [mm].
        unseen: norm of the readings' component that no smooth curve explains [mm].
    """

    run: Observation
    coarse: Observation
    roots: Floats
    seen: Floats
    unseen: float

    def samples_of(self, values: Floats) -> Floats:
        """Return values at all samples, shape (n,), from values at the nodes, shape (m,)."""
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
        """Return the information block of all samples.

        Args:
            columns: shape (k,).
            jacobian: at the nodes, shape (m, k).
            shift: parameter change, shape (k,); jacobian times shift is added to measured less predicted lengths.
        """
        nominal = self.run.raw.circle.bar_mm
        rows = self.roots @ jacobian.reshape(SECTORS, PER_SECTOR, -1)
        explained = self.roots @ (length_mm - nominal).reshape(SECTORS, PER_SECTOR, 1)
        flat = rows.reshape(SECTORS * PER_SECTOR, -1)
        target = self.seen.ravel() - explained.ravel() + flat @ shift
        block = compress(columns, np.vstack([flat, np.zeros(flat.shape[1])]), np.append(target, self.unseen))
        return replace(block, count=len(self.run.raw))


def nodes_of(run: Observation) -> RunNodes | None:
    """Return a run's nodes; None for short runs and for runs with commands per sample."""
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
    # Sectors are processed in groups: weights of all nodes at all samples would need several times the recording's
    # memory.
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
        coarse=replace(run, raw=nodes, finer=None),
        roots=np.ascontiguousarray(triangle[:, :-1, :-1]),
        seen=np.ascontiguousarray(triangle[:, :-1, -1]),
        unseen=norm_of(triangle[:, -1, -1]),
    )


def _in_sectors(phi_deg: Floats) -> tuple[Integers, Floats]:
    place = phi_deg * (SECTORS / FULL_TURN_DEG)
    sector = np.clip(place.astype(np.int64), 0, SECTORS - 1)
    return sector, 2.0 * (place - sector) - 1.0


def smooth(values: Floats) -> bool:
    """Return whether quantities at nodes, shape (m, k), are polynomials in each sector and continuous between sectors.

    Deviations below a billionth are rounding.
    """
    by_sector = values.reshape(SECTORS, PER_SECTOR, -1)
    last = np.abs(np.einsum("p,spk->sk", _LAST, by_sector)).max(axis=0)
    # Polynomials of two neighbouring sectors do not show a step between their outermost nodes.
    begin, end = np.einsum("ep,spk->esk", _interpolation(np.array([-1.0, 1.0])), by_sector)
    step = np.abs(begin[1:] - end[:-1]).max(axis=0)
    return bool(np.all(np.maximum(last, step) <= SMOOTH * np.abs(values).max(axis=0) + NOTHING))


def _interpolation(place: Floats) -> Floats:
    """Return the Lagrange polynomials of the nodes at places from -1 to 1, shape (n, nodes)."""
    distance = place[:, None] - _PLACES
    exact = distance == 0.0
    terms = _WEIGHTS / np.where(exact, 1.0, distance)
    values: Floats = terms / terms.sum(axis=1, keepdims=True)
    on_node = exact.any(axis=1)
    values[on_node] = exact[on_node]
    return values
