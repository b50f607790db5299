"""A column that is declared once goes all the way from a file to an error source."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.errors import InputError
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.journal import run_header, run_line
from dbbstation.files.recordings.run_csv import parse_run
from dbbstation.model.observation import Observation
from dbbstation.model.simulation import setup_of
from dbbstation.plan.plan import Direction
from dbbstation.trace import columns
from dbbstation.trace.columns import COLUMNS, Column, ColumnKind, currents, temperatures
from dbbstation.trace.cut import cut
from dbbstation.trace.recording import averaged

SPEED = Column("spindle_speed_rpm", ColumnKind.OTHER, "rpm", "speed of the spindle", 1, 1e5)


def test_a_new_column_reaches_the_sources_that_ask_for_it(monkeypatch):
    monkeypatch.setitem(COLUMNS, SPEED.name, SPEED)
    test = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml").tests["h"]
    circle = test.run(Direction.CCW)
    theta = np.arange(0.0, 360.0, 0.25)
    names = ("t_s", "length_mm", "theta_deg", SPEED.name)
    rows = [(0.01 * k, circle.bar_mm, angle, 1000.0 + angle) for k, angle in enumerate(theta)]
    lines = [run_line(row, names) for row in rows]
    recording = parse_run(run_header("h", Direction.CCW, 1, names) + b"".join(lines), "h.csv").recording
    raw = cut(recording, circle)
    motion = Observation("h", 1, averaged(raw, 360), setup_of(test)).motion()
    # The angle travelled since the start, which is where the circle begins.
    speed = motion.logged[SPEED.name][motion.kept]
    assert speed == pytest.approx(1000.0 + np.arange(0.375, 360.0, 1.0), abs=0.051)
    too_fast = [run_line((*row[:3], 2e5), names) for row in rows[:2]]
    with pytest.raises(InputError, match=r"spindle_speed_rpm is 200000, sizes up to 100000 rpm are plausible"):
        parse_run(run_header("h", Direction.CCW, 1, names) + b"".join(too_fast), "h.csv")


def test_the_sensors_and_motors_of_the_format():
    of = {kind: [column.of for column in COLUMNS.values() if column.kind is kind] for kind in ColumnKind}
    assert of[ColumnKind.TEMPERATURE] == ["bar", "jig", "machine", *(f"strut{k}" for k in range(1, 7))]
    assert of[ColumnKind.CURRENT] == [f"motor{k}" for k in range(1, 7)]


def test_sensors_and_motors_are_found_by_their_names():
    logged = {**temperatures({"strut3": np.array([20.0, 21.0])}), **currents(np.arange(12.0).reshape(2, 6))}
    assert set(logged) == {"strut3_temp_c", *(f"motor{k}_current_a" for k in range(1, 7))}

    class Carrier(columns.WithLogged):
        pass

    carrier = Carrier()
    carrier.logged = logged
    assert list(carrier.temperature_degc) == ["strut3"]
    assert carrier.motor_current_a == pytest.approx(np.arange(12.0).reshape(2, 6))
    carrier.logged = {"motor2_current_a": np.array([1.0, 2.0])}
    assert carrier.temperature_degc == {}
    assert carrier.motor_current_a[:, 1] == pytest.approx([1.0, 2.0])
    assert np.isnan(np.delete(carrier.motor_current_a, 1, axis=1)).all()
    carrier.logged = {}
    assert carrier.motor_current_a is None
