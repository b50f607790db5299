"""A correction for rows that took no part: what was put into them is taken out, within the u that is stated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.diagnosis.table.applied import applied
from dbbstation.diagnosis.table.data import Table
from dbbstation.diagnosis.table.mismatch import find_mismatch
from dbbstation.inference.channel import Variable
from tests.diagnosis.table.domains import made


def part_of(table: Table, rows: slice, like: Table | None = None) -> Table:
    """Some rows of a table, as other rows than those of `like` if given."""

    def cut(variable: Variable) -> Variable:
        same = next((v for v in like.variables if v.name == variable.name), None) if like else None
        return replace(variable, values=variable.values[rows], range=(same.low, same.high) if same else None)

    variables = tuple(cut(v) for v in table.variables)
    return replace(
        table,
        measured=table.measured[rows],
        simulated=table.simulated[rows],
        variables=variables,
        derivatives={name: column[rows] for name, column in table.derivatives.items()},
        columns={name: column[rows] for name, column in table.columns.items()},
        blocks=(slice(0, len(table.measured[rows])),),
        clock=variables[0] if table.clock else None,
        like=like,
    )


@pytest.mark.parametrize(("kind", "seed"), [("valve", 2), ("growth", 1), ("screw", 1), ("warming", 2), ("spring", 3)])
def test_other_rows_are_corrected_within_u(kind, seed):
    table, scene, drawn = made(kind, seed, effect=True)
    half = 2 * len(table) // 3
    first = part_of(table, slice(0, half))
    found = find_mismatch(first, hold_out=False)
    # What a body remembers from before its first row is not known.
    begun = int(6.0 * scene.true["time constant"]) if kind == "warming" else 0
    same = applied(found, part_of(table, slice(0, half), first))
    assert not same.left_out
    apart = (same.values - found.explained)[begun:]
    assert np.sqrt(np.mean(np.square(apart))) < 0.1 * np.sqrt(np.mean(np.square(same.uncertainty)))
    rest = slice(half, len(table))
    told = applied(found, part_of(table, rest, first))
    inside = np.ones(len(told.values), dtype=bool)
    for v in part_of(table, rest, first).variables[1:] if kind != "screw" else ():  # a pitch goes on
        inside &= (v.values >= v.low) & (v.values <= v.high)
    inside[:begun] = False
    sigma = float(scene.effect.std()) / float(str(drawn["size"]))
    off = (told.values - scene.effect[rest] - 0.5 * sigma)[inside]
    assert np.std(off) < 0.35 * np.std(scene.effect)
    assert np.sqrt(np.mean(np.square(off / told.uncertainty[inside]))) < 2.5


def test_what_happened_in_time_stays_behind():
    table, _, _ = made("growth", 1, effect=True)
    assert table.clock is not None
    drifting = replace(table, measured=table.measured + 200.0 * table.clock.scaled)
    found = find_mismatch(drifting, hold_out=False)
    others = part_of(drifting, slice(0, len(drifting)), drifting)
    told = applied(found, others)
    assert any("t_s" in name for name in told.left_out)
    assert np.std(told.values) < 0.5 * np.std(found.explained)
