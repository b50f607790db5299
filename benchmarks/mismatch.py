"""The comparison of a table, whole, against one fit of all its curves; and how it grows.

    python benchmarks/mismatch.py [--quick] [--json]

A simulated table of 12,000 rows and 12 variables holds an hysteresis, an expansion and a wave, which have to be found. Its peer is
one least-squares fit of a smooth curve over every variable, in the same process. `--quick` is a tenth of the rows, once.
"""

from __future__ import annotations

import sys
from functools import partial

from benchmarks.measuring import Row, show, timed, timed_once  # isort: skip - sets up the environment

import numpy as np

from dbbstation.diagnosis.table.data import Table
from dbbstation.diagnosis.table.mismatch import Mismatch, find_mismatch
from dbbstation.inference.channel import Kind, Variable
from dbbstation.inference.forms import Spline

SEED = 5
ROWS, QUICK_ROWS, VARIABLES = 12_000, 1_200, 12
WANTED_S = 20.0


def table(rows: int, count: int) -> Table:
    """Angles of several axes and loads that move independently, and a residual that follows three of them."""
    rng = np.random.default_rng(SEED)
    t = np.arange(rows) / 20.0
    variables = [Variable("t_s", "s", Kind.TIME, t)]
    for k in range(count - 1):
        rates, phases = rng.uniform(0.05, 0.4, 3), rng.uniform(0.0, 6.0, 3)
        values = np.sin(np.outer(t, rates) + phases) @ [60.0, 40.0, 20.0]
        angle = k % 2 == 0
        kind = Kind.ANGLE if angle else Kind.LENGTH
        variables.append(Variable(f"q{k + 1}", "deg" if angle else "mm", kind, values, 360.0 if angle else None))
    q1, q2, q4 = (variables[k].values for k in (1, 2, 4))
    residual = 0.1 * np.sign(np.gradient(q2)) + 0.002 * q4 + 0.1 * np.sin(2.0 * np.pi * q1 / 17.0)
    measured = residual + 0.1 * rng.standard_normal(rows)
    clock = variables[0]
    one = (slice(0, rows),)
    return Table(measured, np.zeros(rows), "mm", "simulated", tuple(variables), {}, {}, one, ("run",), clock)


def curves(data: Table) -> None:
    """One fit of a smooth curve over every variable."""
    columns = [Spline(v.low, v.high).columns(v.values) for v in data.variables]
    np.linalg.lstsq(np.hstack(columns), data.measured, rcond=None)


def main() -> None:
    """Measure and print."""
    quick = "--quick" in sys.argv
    rows, calls = (QUICK_ROWS, 1) if quick else (ROWS, 3)
    data = table(rows, VARIABLES)
    peer = timed(partial(curves, data), 3)
    found: list[Mismatch] = []
    once = timed(lambda: found.append(find_mismatch(data, hold_out=False)), calls)
    families = {finding.form for finding in found[-1].there}
    if not {"hysteresis", "wave"} <= {str(family) for family in families}:
        raise SystemExit(f"found {families}: this is not the work that was to be measured")
    whole = timed_once(lambda: find_mismatch(data))
    shown = [
        Row("whole comparison", once.best_s, "s", f"{rows:,} rows, {VARIABLES} variables; wanted: below {WANTED_S:g}"),
        Row("  over one fit of all curves", once.best_s / peer.best_s, "times"),
        Row("with ten held-out parts", whole, "s", "everything chosen anew without each"),
        Row("  over one fit of all curves", whole / peer.best_s, "times"),
    ]
    title = "comparison of a table" + (", quick form" if quick else "")
    show(title, shown, f"best of {calls} after one that warms up; with held-out parts: once")


if __name__ == "__main__":
    main()
