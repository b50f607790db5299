"""Circles of a hexapod as a simulator: the kinematics of the station, with a port on two of its struts.

What acts at a port is a strut that is longer than it is commanded to be; the pose is that which all struts then have.
"""

import numpy as np

from dbbstation.diagnosis.simulator.contract import Simulator
from dbbstation.errors import KinematicsError
from dbbstation.machine.geometry import Frames, Hexapod, Rotation
from dbbstation.machine.kinematics import forward, inverse
from tests.plant.machine import reference_machine

BAR_MM = 150.0


class HexapodCircles(Simulator):
    def __init__(self):
        plant = reference_machine()
        self.lead_mm = plant.screw_lead_mm
        self.hexapod = Hexapod(plant.base_joints_mm, plant.platform_joints_mm)

    def simulate(self, inputs, parameters, ports):
        t = inputs["t"]
        commanded = Frames.from_poses(np.stack([inputs[axis] for axis in "xyzabc"], axis=1), Rotation.XYZ)
        length = inverse(self.hexapod, commanded).length_mm
        speed, screw = np.gradient(length, t, axis=0), 2.0 * np.pi * length / self.lead_mm
        actual = length.copy()
        for port, strut in ((ports.strut_3, 2), (ports.strut_5, 4)):
            actual[:, strut] += 1e-3 * port(t, {"speed": speed[:, strut], "screw": screw[:, strut]})
        moved = actual != length
        try:
            found = forward(self.hexapod, actual, commanded) if moved.any() else commanded
        except KinematicsError as error:
            raise ArithmeticError("no pose has these struts") from error  # a dose that is too large: it ran away
        ball = np.array([[inputs[axis][0] for axis in ("cx", "cy", "cz")]])
        ball = ball + 1e-3 * np.array([parameters[f"ball_{axis}"] for axis in "xyz"])
        return {"bar": 1e3 * (np.linalg.norm(found.position_mm - ball, axis=1) - BAR_MM) + parameters["bar"]}
