"""At a fault the generated kinematics stops LinuxCNC, and no joint jumps; the machine goes on once the fault is mended."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.control.kinematics import component
from dbbstation.demo.in_control import made_kins
from dbbstation.files.places import package_text
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources
from dbbstation.virtual.linuxcnc import installed_component, missing, started
from tests.control.in_linuxcnc import NAME
from tests.control.machines import THERMOMETERS, machine
from tests.control.test_parameters import truth_of
from tests.nc.planner.required import needs

if TYPE_CHECKING:
    from dbbstation.machine.geometry import Machine

pytestmark = [needs(missing(kinematics=True)), pytest.mark.xdist_group("linuxcnc"), pytest.mark.slow]

DRIVER = Path(__file__).with_name("faults_drive.py")
FEED = 3000.0
START = "G0 X0 Y0 Z-1000 A0 B0 C0"
RANGE, UNSOLVED, THERMOMETER = 1, 2, 3

# Per servo cycle. A strut lengthens by at most what the tool and a platform joint go: half as much again is no jump.
STEP_MM = 1.5 * FEED / 60.0 / 1000.0


def told(model: MachineModel, steps: list[str], folder: Path) -> tuple[list[dict[str, object]], np.ndarray]:
    """What came of each step, and the joints of all servo cycles, shape (n, 6) [mm]."""
    made = component(model, package_text, NAME, "0" * 64, thermometers=THERMOMETERS)
    (folder / f"{NAME}.comp").write_text(made.text)
    zero = (f"setp {NAME}.machine-zero-c 20", f"setp {NAME}.machine-temp-c 20") if made.thermometers else ()
    kins = made_kins(model.machine, NAME, *zero)
    text = "\n".join([START, f"G1 F{FEED} X1", *steps])
    with (
        installed_component(folder / f"{NAME}.comp"),
        started(text, 1000.0, 1, kins, driver=DRIVER) as (ran, printed),
    ):
        assert (ran / "told.json").exists(), printed
        found = json.loads((ran / "told.json").read_text())
        joints = np.loadtxt(ran / "samples.txt", comments="o")[:, 1:7]
    assert found["homed"]
    return found["steps"], joints


def jump_mm(joints: np.ndarray) -> float:
    return float(np.abs(np.diff(joints, axis=0)).max())


def stops(step: dict[str, object], fault: int) -> bool:
    """Whether a step faults, the machine is off then, and LinuxCNC says why."""
    return (step["fault"], step["enabled"]) == (fault, False) and "kinematicsInverse failed" in str(step["said"])


def goes_on(steps: list[dict[str, object]]) -> bool:
    return all((step["fault"], step["enabled"]) == (0, True) for step in steps)


def test_a_thermometer_that_stands_still_or_breaks(reference: Machine, tmp_path: Path) -> None:
    warm = known_sources()["thermal-struts"].by_temperature()
    assert warm is not None
    cold = truth_of(machine(reference, 0), "gravity")
    model = replace(cold, sources=(*cold.sources, Fitted(warm, np.array([11.0]))))
    mended = ["setp patience-s 600", "setp machine-temp-c 20.1", "on", "G1 X20"]
    switched = ["setp use-gravity 0", "G1 X10"]
    found, joints = told(model, ["setp patience-s 0.5", *mended, *switched, "setp machine-temp-c 51"], tmp_path)
    assert goes_on(found[:2])
    assert stops(found[2], THERMOMETER)
    assert goes_on(found[5:9])  # from `on` on; a part that is switched off while enabled stays until the machine is off
    assert stops(found[9], THERMOMETER)
    assert jump_mm(joints) < STEP_MM


@pytest.mark.parametrize(
    ("beyond", "jog", "fault"),
    [("G1 Z-1900", "jog Z -50", RANGE), ("G1 C175", "jog C 10", UNSOLVED)],
    ids=["strut range", "folding"],
)
def test_a_pose_that_has_no_joints(beyond: str, jog: str, fault: int, reference: Machine, tmp_path: Path) -> None:
    """LinuxCNC refuses a move there before it begins; a jog, which it does not look at before, stops on the way."""
    found, joints = told(truth_of(machine(reference, 0), "gravity", "screw-lead"), ["G1 X50", beyond, jog], tmp_path)
    assert goes_on(found[:3])
    assert (found[3]["fault"], found[3]["enabled"]) == (fault, True)
    assert "fails kinematicsInverse" in str(found[3]["said"])
    assert stops(found[4], fault)
    assert jump_mm(joints) < STEP_MM
    assert np.ptp(joints, axis=0).max() > 10.0  # the jog had gone on until then
