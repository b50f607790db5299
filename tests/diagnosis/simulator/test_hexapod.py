"""The hexapod's own simulation, asked at ports on its struts, about circles of a machine that shares no code with it."""

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.diagnosis.simulator.answer import find
from dbbstation.diagnosis.simulator.contract import simulated
from dbbstation.diagnosis.simulator.model import Model, Output, SimulatorParameter, SimulatorPort, SimulatorRecording
from tests.diagnosis.simulator.hexapod import HexapodCircles
from tests.plant.linear import LinearSession
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.screw import ScrewCyclic
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import scene_of

NOISE_UM = 0.1
GAP_UM, AMPLITUDE_UM = 4.0, 1.5
NONE = (0.0,) * 6


def model_of(mechanisms, seed=1):
    rng, session = np.random.default_rng(seed), LinearSession(scene_of(subset(table_ii_plan(3), ["a", "h"])), 180)
    readings, runs = session.signature(mechanisms), []
    for course in session.courses:
        own, readings = np.split(readings, [int(course.kept.sum())])
        poses, centre = course.motion.commanded[course.kept], course.slot.path.centre_mm
        inputs = {"t": course.motion.session_s[course.kept], **dict(zip("xyzabc", poses.T, strict=True))}
        inputs |= {f"c{axis}": np.full(len(poses), centre[k]) for k, axis in enumerate("xyz")}
        base = np.linalg.norm(course.nominal.position_mm[course.kept] - centre, axis=1) - 150.0
        measured = 1e3 * (base + own) + NOISE_UM * rng.standard_normal(len(own))
        runs.append(SimulatorRecording(course.slot.stem, inputs, {"bar": measured}))
    parameters = [SimulatorParameter(f"ball_{axis}", f"ball_{axis}", 0.0, "µm", 2.0) for axis in "xyz"]
    parameters.append(SimulatorParameter("bar", "bar", 0.0, "µm", 1.0))
    signals = {"speed": "mm/s", "screw": "rad"}
    ports = tuple(SimulatorPort(f"strut_{k}", "µm", signals) for k in (3, 5))
    return Model("hexapod", tuple(parameters), ports, (Output("bar", "µm"),), tuple(runs))


def asked(mechanisms, **options):
    model, simulator, known = model_of(mechanisms), HexapodCircles(), {}

    def run(asks):
        for ask in asks:
            if ask not in known:
                known[ask] = simulated(simulator, model, ask)
        return [known[ask] for ask in asks]

    return find(model, run, hold_out=False, **options)


def of_strut(number, value):
    return tuple(value if k + 1 == number else 0.0 for k in range(6))


@pytest.mark.nightly
def test_backlash_and_a_screw_out_of_true_are_found_at_their_struts():
    screw = replace(ScrewCyclic(), amplitude_um=of_strut(5, AMPLITUDE_UM))
    answer = asked([Backlash(gap_um=of_strut(3, GAP_UM)), screw])
    found = {one.name: one.values for one in answer.identified}
    # What turns with the sense of travel, over a width since a gap takes time to cross: backlash in the words of `diagnose`.
    assert set(found) == {"limited of speed at strut_3", "periodic of screw at strut_5"}
    slope, width = found["limited of speed at strut_3"].values()
    # A strut that grows stays behind by half of the gap.
    half = -0.5 * GAP_UM
    assert abs(slope.value * width.value - half) < 2.0 * abs(half) * np.hypot(0.02, width.uncertainty / width.value)
    waves = found["periodic of screw at strut_5"]
    amplitude = np.hypot(waves["cosine"].value, waves["sine"].value)
    assert abs(amplitude - AMPLITUDE_UM) < 2.0 * waves["sine"].uncertainty + 2.0 * waves["cosine"].uncertainty


@pytest.mark.nightly
def test_nothing_is_found_at_struts_that_follow():
    assert not asked([]).identified
