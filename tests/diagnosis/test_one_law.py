"""A law that is written once is found in a table, in a drive, at a port of a simulator and in the struts of a hexapod."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from dbbstation.files.own_sources import every_source
from dbbstation.machine.geometry import Frames
from dbbstation.machine.kinematics import inverse
from dbbstation.sources.contract import Motion
from dbbstation.sources.of_struts import moving_columns
from dbbstation.sources.trial import trial_machine
from dbbstation.tasks.calibrate import calibrate
from dbbstation.tasks.drive import identify
from dbbstation.tasks.mismatch import mismatch
from tests.diagnosis.drive.plant import Truth, to_and_fro
from tests.diagnosis.drive.plant import record as record_drive
from tests.plant.mechanisms.base import Mechanism
from tests.plant.plan import EIGHT, subset, table_ii_plan
from tests.plant.session import record

LAW = Path("fixtures/sources/soft_friction.py").resolve()
SIZE, WIDTH_MM_S = 6.0, 3.0
STRUTS_UM = np.array([6.0, -4.0, 0.0, 8.0, 5.0, -7.0])


def effect(speed_mm_s):
    return SIZE * np.tanh(speed_mm_s / WIDTH_MM_S)


def holds(value, true, floor=0.0):
    return abs(value.value - true) < 3.0 * value.uncertainty + floor


def test_in_a_table():
    t = np.linspace(0.0, 40.0, 600)
    speed, simulated = 8.0 * np.sin(t), 3.0 * np.cos(1.7 * t)
    measured = simulated + effect(speed) + np.random.default_rng(4).normal(0.0, 0.5, 600)
    table = {"speed_mm_s": speed, "measured_um": measured, "simulated_um": simulated}
    found = mismatch([table], "measured_um", "simulated_um", time="rows", source_files=[LAW], held_out=False)
    (own,) = [one for one in found.findings if one.name == "soft-friction"]
    assert own.verdict == "identified"
    assert holds(own.values["size_1"], SIZE)


def test_in_a_drive(tmp_path):
    truth = Truth(load=lambda _t, _x, v: float(4.0 * effect(1e3 * v)))
    slow = to_and_fro(speeds=(0.001, 0.002, 0.004, 0.006, 0.012), stroke=0.006, acceleration=0.05, seconds=30.0)
    file = tmp_path / "strut.csv"
    rows = np.column_stack(record_drive(truth, slow))
    np.savetxt(file, rows, delimiter=",", fmt="%.9g", header="t_s,position_mm,force_n", comments="")
    found = identify([file], sources=["stiffness"], source_files=[LAW], held_out=False)
    own = next(one for one in found.sources if one.name == "soft-friction")
    assert own.verdict == "identified"
    assert holds(own.parameters["size_1"], 4.0 * SIZE)


SIMULATOR = """
import numpy as np
from dbbstation.own import Simulator


class Sled(Simulator):
    def simulate(self, inputs, parameters, ports):
        t, push, speed, found = inputs["t"], inputs["push"], 0.0, []
        for k in range(len(t)):
            found.append(speed)
            step = t[min(k + 1, len(t) - 1)] - t[k]
            speed += step * (push[k] - parameters["rate"] * speed + ports.force(t[k], {"speed_mm_s": speed}))
        return {"speed": np.array(found)}
"""
MODEL = """format: dbb-simulator/1
name: sled
python: sled.py
time: t_s
inputs: {push: push_mm_s2}
parameters:
  rate: {value: 0.4, unit: 1/s, low: 0.1, high: 2}
outputs:
  speed: {column: speed_mm_s, unit: mm/s}
ports:
  force: {unit: mm/s^2, signals: {speed_mm_s: mm/s}}
"""


def test_at_a_port(tmp_path, monkeypatch):
    monkeypatch.setattr("dbbstation.simulators.kept.simulations_folder", lambda: tmp_path / "kept")
    step, speed, found = 0.1, 0.0, []
    t = step * np.arange(80)
    push = 14.0 * np.sin(1.3 * t)
    for k in range(len(t)):  # Euler's steps, as the simulator takes them
        found.append(speed)
        speed += step * (push[k] - 0.4 * speed - effect(speed))
    measured = np.array(found) + np.random.default_rng(3).normal(0.0, 0.01, len(t))
    rows = np.column_stack([t, push, measured])
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header="t_s,push_mm_s2,speed_mm_s", comments="")
    (tmp_path / "model.yaml").write_text(MODEL, "utf-8")
    (tmp_path / "sled.py").write_text(SIMULATOR, "utf-8")
    answer = mismatch(
        [tmp_path / "run.csv"],
        simulator=tmp_path / "model.yaml",
        source_files=[LAW],
        held_out=False,
    )
    own = next(one for one in answer.findings if one.name.startswith("soft-friction"))
    assert own.verdict == "identified"
    assert holds(own.values["size_1"], -SIZE)


@dataclass(frozen=True)
class SoftStruts(Mechanism):
    """Struts that are longer by the law of their commanded speed, in the independent virtual machine."""

    name: ClassVar[str] = "soft-struts"
    listed: ClassVar[bool] = False

    def driven_mm(self, motion, driven_mm):
        speed = np.gradient(driven_mm, motion.session_s, axis=0)
        return 1e-3 * STRUTS_UM * np.tanh(speed / WIDTH_MM_S)


def test_in_the_struts_of_a_hexapod(tmp_path):
    plan = subset(table_ii_plan(41), EIGHT)
    record(tmp_path / "session", seed=41, plan=plan, mechanisms=[SoftStruts()], rate_hz=10.0)
    sources = "strut-reference-length,base-joints,soft-friction"
    found = calibrate(tmp_path / "session", sources=sources, source_files=[LAW])
    for k, true in enumerate(STRUTS_UM, 1):
        # Backward differences are half a sample of 0.1 s late, and the geometry takes a part of what is smooth.
        assert holds(found.parameters[f"soft-friction.strut_{k}_size_1"], true, floor=0.3)
    assert found.parameters["soft-friction.width_mm_s"].value == pytest.approx(WIDTH_MM_S, rel=0.15)


def test_the_columns_of_a_strut_are_those_of_its_commanded_length():
    machine, t = trial_machine(), np.linspace(0.0, 30.0, 601)
    poses = np.zeros((len(t), 6))
    poses[:, 0], poses[:, 2] = 40.0 * np.sin(0.4 * t), -1000.0
    columns = moving_columns(Motion(poses, is_path=True, time_s=t), machine)
    length = inverse(machine.hexapod, Frames.from_poses(poses, machine.hexapod.rotation)).length_mm
    assert columns["position_mm"] == pytest.approx(length)
    midway = 0.5 * (columns["speed_mm_s"][1:-1] + columns["speed_mm_s"][2:])
    assert midway == pytest.approx((length[2:] - length[:-2]) / (t[2:] - t[:-2])[:, None], abs=1e-9)
    for strut in range(6):
        turn = int(np.argmax(np.abs(length[: len(t) // 4, strut] - length[0, strut])))
        since, way = columns["since_reversal_mm"][:, strut], columns["direction"][:, strut]
        assert np.isinf(since[: turn - 1]).all()
        assert since[turn + 20] == pytest.approx(abs(length[turn + 20, strut] - length[turn, strut]), abs=2e-3)
        assert way[turn - 5] == -way[turn + 5] == np.sign(length[turn, strut] - length[turn - 5, strut])


def test_a_strut_has_no_other_columns():
    with pytest.raises(Exception, match="needs place_mm, oil_temp_c, which a strut does not have; a strut has t_s"):
        every_source([Path("fixtures/sources/screw_expansion.py").resolve()])
