"""Odd machines among forty, and false alarms: `python -m tests.sisters.odd_machines --draws 500`.

Forty machines with their true parameters, and estimates with the covariance of a real calibration of virtual circles. Where three of them are odd, each is so in one
parameter, off by a number of times what machines scatter and a calibration leaves open together.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from dbbstation.sisters.unlike import FALSE_ALARMS, unlike_machines
from dbbstation.tasks.calibrate import calibrate
from tests.plant.plan import elevated, table_ii_plan
from tests.plant.session import record

MACHINES, ODD = 40, 3
SCATTER_UM = 20.0
"""Standard deviation of joints and strut lengths from machine to machine [µm]."""


@dataclass(frozen=True)
class Counted:
    """What came of some draws.

    Attributes:
        found: odd machines that were marked, of all.
    """

    draws: int
    found: int
    odd: int
    false_machines: int
    alarmed: int


@cache
def covariance_um():
    """Covariance of strut lengths and base joints in a calibration of fifteen circles, five of them raised [µm²], without what was held."""
    with tempfile.TemporaryDirectory() as folder:
        record(Path(folder) / "s", seed=36, plan=elevated(table_ii_plan(36), 5.0, "abcde"), rate_hz=10.0)
        model = calibrate(Path(folder) / "s").model
    rows = [k for k, row in enumerate(model.covariance_rows) if row[0] in {"strut-reference-length", "base-joints"}]
    found = 1e6 * model.covariance[np.ix_(rows, rows)]
    kept = np.diag(found) > 0.0
    return found[np.ix_(kept, kept)]


def drawn(rng, root, u, size):
    """Values of every parameter and machine, shape (q, n) [µm]; the first machines are odd by `size` standard deviations, 0 for none."""
    count = len(u)
    estimates = rng.normal(0.0, SCATTER_UM, (count, MACHINES)) + root @ rng.normal(size=(root.shape[1], MACHINES))
    for machine in range(ODD if size else 0):
        which = int(rng.integers(count))
        estimates[which, machine] += rng.choice([-1.0, 1.0]) * size * np.hypot(SCATTER_UM, u[which])
    return estimates


def counted(draws, size, seed, false_alarms=FALSE_ALARMS):
    rng = np.random.default_rng([seed, int(10 * size)])
    covariance = covariance_um()
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    u = np.sqrt(np.diag(covariance))
    odd = ODD if size else 0
    found = false = alarmed = 0
    for _ in range(draws):
        every = drawn(rng, root, u, size)
        marked = unlike_machines(every, np.broadcast_to(u[:, None], every.shape), false_alarms).any(axis=0)
        found += int(marked[:odd].sum())
        false += int(marked[odd:].sum())
        alarmed += bool(marked[odd:].any())
    return Counted(draws, found, draws * odd, false, alarmed)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=500)
    parser.add_argument("--seed", type=int, default=36)
    arguments = parser.parse_args()
    print(f"{MACHINES} machines, {len(covariance_um())} quantities, stated {FALSE_ALARMS:g}, seed {arguments.seed}")
    for size in (0.0, 4.0, 5.0, 6.0, 8.0):
        one = counted(arguments.draws, size, arguments.seed)
        share = f"odd found {one.found} of {one.odd}" if one.odd else "none is odd"
        print(
            f"off by {size:g}: {share}, draws with a false alarm {one.alarmed} of {one.draws}, machines marked falsely {one.false_machines}"
        )


if __name__ == "__main__":
    main()
