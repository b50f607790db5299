"""LinuxCNC, headless, drives a virtual machine with hidden errors through its joints, by the kinematics made of them.

Needs LinuxCNC and halcompile (packages `linuxcnc-uspace` and `linuxcnc-uspace-dev`), and root to install a module.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.demo.in_control import made_kins
from dbbstation.model.machine_model import MachineModel
from dbbstation.virtual.linuxcnc import missing, run
from tests.control.in_linuxcnc import NAME, circle_of, circle_program, installed
from tests.control.machines import machine
from tests.control.test_parameters import truth_of
from tests.nc.planner.required import needs

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.machine.geometry import Machine

pytestmark = [needs(missing(kinematics=True)), pytest.mark.xdist_group("linuxcnc")]

FASTER = 4
RADIUS_MM, TILT_DEG, FEED, Z_MM = 150.0, (10.0, 10.0), 3000.0, -1000.0
CENTRE = np.array([0.0, 0.0, Z_MM, *TILT_DEG, 0.0])


@pytest.mark.slow
def test_the_real_machine_makes_the_programmed_circle(reference: Machine, tmp_path: Path) -> None:
    of = machine(reference, 0)
    truth = truth_of(of, "gravity", "screw-lead", "screw-cyclic")
    text = circle_program(RADIUS_MM, TILT_DEG, FEED, Z_MM)
    with installed(truth, tmp_path):
        ran = run(text, faster=FASTER, kins=made_kins(of, NAME))
    found = circle_of(truth, ran, CENTRE, RADIUS_MM)
    assert np.abs(found.centre_um).max() < 0.1
    assert found.roundness_um < 1.0
    assert found.tilt_deg < 1e-5
    # As long as without any kinematics, whose axes are the program's own.
    assert found.seconds == pytest.approx(run(text, faster=FASTER).duration_s, rel=0.005)
    # The same joints under a nominal control make another circle: the errors are there.
    wrong = circle_of(MachineModel(of), ran, CENTRE, RADIUS_MM)
    assert np.abs(wrong.centre_um).max() > 20.0
