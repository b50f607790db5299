"""An arm of two joints in MuJoCo as a simulator: both are driven by torques, and a torque may act at the elbow.

The recording comes from MuJoCo, too, by a model that has a spring in the elbow; what a spring does there is MuJoCo's own.
"""

import mujoco
import numpy as np

from dbbstation.diagnosis.simulator.contract import Simulator
from dbbstation.diagnosis.simulator.model import Model, Output, SimulatorParameter, SimulatorPort, SimulatorRecording

SUBSTEPS, STEP_S = 2, 0.01
SPRING, LOAD, DAMPING = 0.6, 0.5, 0.05
FASTEST = 200.0  # [rad/s]
JOINTS = ("shoulder", "elbow")
XML = """
<mujoco>
  <option timestep="{step}" integrator="Euler"><flag eulerdamp="disable"/></option>
  <worldbody>
    <body>
      <joint name="shoulder" axis="0 1 0" damping="0.1"/>
      <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.3" mass="0.8" contype="0" conaffinity="0"/>
      <body pos="0 0 -0.3">
        <joint name="elbow" axis="0 1 0" damping="0.05" stiffness="{spring}"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0 0 -0.25" mass="0.5" contype="0" conaffinity="0"/>
        <body name="load" pos="0 0 -0.25"><geom type="sphere" size="0.03" mass="{load}" contype="0" conaffinity="0"/></body>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="shoulder"/><motor joint="elbow"/></actuator>
</mujoco>
"""


class Arm(Simulator):
    """Angles of both joints [rad]; the arm begins at rest, hanging."""

    def __init__(self, spring=0.0):
        self.spring = spring

    def simulate(self, inputs, parameters, ports):
        text = XML.format(step=STEP_S, spring=self.spring, load=parameters["load"])
        model = mujoco.MjModel.from_xml_string(text)
        model.dof_damping[1] = parameters["damping"]
        data, found = mujoco.MjData(model), []
        for shoulder, elbow in zip(inputs["shoulder"].tolist(), inputs["elbow"].tolist(), strict=True):
            found.append(data.qpos.copy())
            data.ctrl[:] = shoulder, elbow
            for _ in range(SUBSTEPS):
                if np.abs(data.qvel).max() > FASTEST:
                    raise OverflowError  # it ran away; MuJoCo would begin anew, and write a file about it
                signals = {"angle": float(data.qpos[1]), "speed": float(data.qvel[1])}
                data.qfrc_applied[1] = ports.elbow(data.time, signals)
                mujoco.mj_step(model, data)
        return dict(zip(JOINTS, np.array(found).T, strict=True))


class _Nothing:
    def elbow(self, _t, _signals):
        return 0.0


def model_of(seed, spring):
    """The simulator's model with a recording of an arm with a spring of so many N m/rad."""
    rng = np.random.default_rng(seed)
    rows = 200
    inputs = {"t": STEP_S * SUBSTEPS * np.arange(rows)}
    for joint, size in zip(JOINTS, (2.0, 1.0), strict=True):
        inputs[joint] = np.repeat(rng.uniform(-size, size, rows // 25), 25)
    true = Arm(spring).simulate(inputs, {"load": LOAD, "damping": DAMPING}, _Nothing())
    measured = {name: values + 0.001 * rng.standard_normal(rows) for name, values in true.items()}
    parameters = (
        SimulatorParameter("load", "load", 0.6, "kg", low=0.05, high=5.0),
        SimulatorParameter("damping", "damping", 0.08, "N m s", low=0.001, high=2.0),
    )
    ports = (SimulatorPort("elbow", "N m", {"angle": "rad", "speed": "rad/s"}),)
    outputs = tuple(Output(name, "rad") for name in JOINTS)
    return Model("arm", parameters, ports, outputs, (SimulatorRecording("run", inputs, measured),))
