"""One file of a user's physics works in a drive and in a table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dbbstation.errors import InputError
from dbbstation.tasks.drive import identify
from dbbstation.tasks.mismatch import mismatch
from tests.diagnosis.drive.plant import Truth, record, to_and_fro

BELLOWS = Path("fixtures/sources/bellows.py").resolve()
END_N = 25.0


def force_n(position_mm):
    return END_N * ((position_mm - 100.0) / 100.0) ** 3


def holds(value):
    return abs(value.value - END_N) < 3.0 * value.uncertainty


def test_a_law_of_ones_own_is_found_in_a_drive(tmp_path):
    truth = Truth(coulomb=20.0, load=lambda _t, x, _v: float(force_n(1e3 * x)))
    t, position, force = record(truth, to_and_fro(seconds=16.0))
    file = tmp_path / "strut.csv"
    rows = np.column_stack([t, position, force])
    np.savetxt(file, rows, delimiter=",", fmt="%.9g", header="t_s,position_mm,force_n", comments="")
    found = identify([file], sources=["coulomb-friction", "stiffness"], source_files=[BELLOWS], held_out=False)
    of = {one.name: one for one in found.sources}
    assert of["bellows"].verdict == "identified"
    assert holds(of["bellows"].parameters["end_n"])
    assert of["stiffness"].verdict in {"ruled-out", "not-testable"}


def test_the_same_file_is_found_in_a_table():
    rng = np.random.default_rng(4)
    position = 100.0 + 100.0 * np.sin(np.linspace(0.0, 40.0, 600))
    simulated = 3.0 * np.cos(np.linspace(0.0, 40.0, 600))
    measured = simulated + force_n(position) + rng.normal(0.0, 0.5, 600)
    table = {"position_mm": position, "measured_n": measured, "simulated_n": simulated}
    found = mismatch([table], "measured_n", "simulated_n", time="rows", source_files=[BELLOWS], held_out=False)
    (own,) = [one for one in found.findings if one.name == "bellows"]
    assert own.verdict == "identified"
    assert holds(own.values["end_n"])


def test_physics_of_other_columns_is_not_compared(tmp_path):
    source = tmp_path / "warm.py"
    source.write_text(BELLOWS.read_text().replace('("position_mm",)', '("oil_degc",)'))
    said = []
    identify(
        ["fixtures/drives/strut.csv"],
        sources=["coulomb-friction"],
        source_files=[source],
        held_out=False,
        say=said.append,
    )
    assert "bellows is not compared: a recording of a drive has no column oil_degc" in said


def test_a_recording_in_memory_is_that_of_its_file():
    file = "fixtures/drives/strut.csv"
    names = ("t_s", "position_mm", "force_n")
    lines = [line for line in Path(file).read_text("utf-8").splitlines() if not line.startswith("#")]
    table = np.genfromtxt(lines, delimiter=",", names=True)
    given = {name: table[name] for name in names}
    asked = {"sources": ["coulomb-friction"], "held_out": False}
    read, memory = identify(file, **asked), identify(given, **asked)
    assert memory.parameters == read.parameters
    assert identify([given], **asked).parameters == read.parameters
    with pytest.raises(InputError, match="there is no column `t_s`"):
        identify({"position_mm": given["position_mm"], "force_n": given["force_n"]})
    with pytest.raises(InputError, match=r"recording 1:2: force_n is ``, not a finite number"):
        identify(given | {"force_n": np.full(len(table), np.nan)})
