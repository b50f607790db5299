"""Units that names and statements have."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.diagnosis.table.units import meaning_of, stated_meaning
from dbbstation.errors import ArgumentError
from dbbstation.inference.channel import Base, Channel, Kind, Variable
from dbbstation.inference.settle import settle
from dbbstation.tasks.tables import stated_variables


@pytest.mark.parametrize(
    ("name", "unit", "kind"),
    [
        ("X_l_min", "l/min", Kind.ANY),
        ("speed_v_s", "V/s", Kind.ANY),
        ("feed_mm_min", "mm/min", Kind.SPEED),
        ("t_min", "min", Kind.TIME),
        ("elapsed_time_h", "h", Kind.TIME),
        ("dead_time_s", "s", Kind.TIME),
        ("delay_s", "s", Kind.ANY),
        ("load_n", "N", Kind.FORCE),
    ],
)
def test_a_time_behind_an_amount_is_a_rate(name, unit, kind):
    found = meaning_of(name)
    assert (found.unit, found.kind) == (unit, kind)


def test_a_driven_variable_is_stated_with_its_unit_or_without():
    found = stated_variables("q1=deg, torque=N m:result, current_a:result")
    assert found["q1"] == stated_meaning("deg")
    assert (found["torque"].unit, found["torque"].driven) == ("N m", True)
    assert (found["current_a"].unit, found["current_a"].driven) == ("A", True)
    with pytest.raises(ArgumentError, match="torque=N m:cause"):
        stated_variables("torque=N m:cause")


@pytest.mark.parametrize("driven", ["cause", "torque"])
def test_of_two_that_say_the_same_the_driven_one_comes_second(driven):
    rng = np.random.default_rng(3)
    rows = 300
    values = np.sin(np.arange(rows) / 11.0)
    columns = {"cause": values, "torque": values + 1e-3 * rng.standard_normal(rows)}
    channel = Channel(
        residual=0.3 * values + 0.1 * rng.standard_normal(rows),
        unit="mm",
        blocks=(slice(0, rows),),
        names=("run",),
        variables=tuple(Variable(n, "", Kind.ANY, v, driven=n == driven) for n, v in columns.items()),
        base=Base.flat(("offset",), np.ones((rows, 1))),
    )
    settled = settle(channel, look=False, thorough=False)
    (name,) = settled.best.names
    assert name == f"linear in {'torque' if driven == 'cause' else 'cause'}"
