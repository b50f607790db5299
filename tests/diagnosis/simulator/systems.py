"""Simulators with concealed effects: each lacks one thing that its recording has, and has parameters that can hide part of it.

The recordings come from the same integrator with the truth at a port, in steps ten times as fine, with noise.
"""

from dataclasses import dataclass, field

import numpy as np

from dbbstation.diagnosis.simulator.answer import find
from dbbstation.diagnosis.simulator.contract import Simulator, simulated
from dbbstation.diagnosis.simulator.model import Model, Output, SimulatorParameter, SimulatorPort, SimulatorRecording

SUBSTEPS = 2


class Stepped(Simulator):
    """Heun's method over `rate(t, state, u, parameters, ports)`; the input is held for a row."""

    def __init__(self, rate, seen, states, substeps=SUBSTEPS):
        self.rate, self.seen, self.states, self.substeps = rate, seen, states, substeps

    def simulate(self, inputs, parameters, ports):
        times = inputs["t"].tolist()
        names = [name for name in inputs if name != "t"]
        rows = list(zip(*(inputs[name].tolist() for name in names), strict=True))
        state, p = [parameters[name] for name in self.states], parameters
        found = []
        for k, t in enumerate(times):
            u = dict(zip(names, rows[k], strict=True))
            found.append(self.seen(t, state, u, p, ports))
            if k + 1 == len(times):
                break
            h = (times[k + 1] - t) / self.substeps
            for n in range(self.substeps):
                a = self.rate(t + n * h, state, u, p, ports)
                b = self.rate(t + (n + 1) * h, [x + h * dx for x, dx in zip(state, a, strict=True)], u, p, ports)
                state = [x + 0.5 * h * (dx + dy) for x, dx, dy in zip(state, a, b, strict=True)]
        return {"out": np.array(found)}


@dataclass(frozen=True)
class System:
    """A simulator, its truth, and what may be said of it.

    Attributes:
        make: a simulator with so many substeps.
        parameters: name to true value and value to begin with.
        states: initial states, true values.
        ports: of the model.
        truth: what acts at a port in truth, made anew for each recording: a function of time and signals.
        right: beginnings of names of which each found term must have one, and one must be found.
        inputs: of the recording.
        noise: of one row.
        resembles: beginnings of names that are honest where they are `ambiguous`, and wrong where they are claimed.
    """

    make: object
    parameters: dict
    states: dict
    ports: tuple
    truth: dict
    right: tuple
    inputs: dict
    noise: float
    unit: str = "m"
    values: dict = field(default_factory=dict)
    resembles: tuple = ()


def held(rng, rows, each, size):
    return np.repeat(rng.uniform(-size, size, rows // each + 1), each)[:rows]


class _Truth:
    """Ports with the truth at one of them."""

    def __init__(self, truth):
        for name, make in truth.items():
            setattr(self, name, make())


def model_of(system, seed, *, clean=False):
    """The model with a recording of the truth, or of a twin that has nothing that the simulator lacks."""
    rng = np.random.default_rng(seed)
    inputs = system.inputs(rng)
    truth = {name: (lambda: lambda _t, _s: 0.0) if clean else make for name, make in system.truth.items()}
    nothing = {port.name: (lambda: lambda _t, _s: 0.0) for port in system.ports}
    true = {name: one[0] for name, one in system.parameters.items()} | system.states
    out = system.make(10 * SUBSTEPS).simulate(inputs, true, _Truth(nothing | truth))["out"]
    measured = out + system.noise * rng.standard_normal(len(out))
    parameters = [SimulatorParameter(name, name, begin, low=1e-6) for name, (_, begin) in system.parameters.items()]
    parameters += [SimulatorParameter(name, name, value) for name, value in system.states.items()]
    recorded = SimulatorRecording("run 1", inputs, {"out": measured})
    return Model("test", tuple(parameters), system.ports, (Output("out", system.unit),), (recorded,))


def asked(system, seed, *, clean=False, hold_out=True):
    model, simulator, known = model_of(system, seed, clean=clean), system.make(SUBSTEPS), {}

    def run(asks):
        for ask in asks:
            if ask not in known:
                known[ask] = simulated(simulator, model, ask)
        return [known[ask] for ask in asks]

    return find(model, run, hold_out=hold_out)


def verdict_of(system, answer):
    """`right`, `ambiguous`, `missed` or `wrong`: what was said of a system with an effect."""
    named = [one.name for one in answer.findings if one.verdict in {"identified", "happened"}]
    if any(not name.startswith(system.right) for name in named):
        return "wrong"
    if named:
        return "right"
    open_ = [one.name for one in answer.findings if one.verdict == "ambiguous"]
    return "ambiguous" if any(name.startswith(system.right + system.resembles) for name in open_) else "missed"


def _mass(noise, truth, right, values=None):
    ports = (SimulatorPort("force", "N", {"place": "m", "speed": "m/s"}),)

    def rate(t, x, u, p, ports):
        push = ports.force(t, {"place": x[0], "speed": x[1]})
        return [x[1], (u["push"] - p["stiffness"] * x[0] - p["damping"] * x[1] + push) / p["mass"]]

    return System(
        make=lambda n: Stepped(rate, lambda _t, x, _u, _p, _ports: x[0], ("place", "speed"), n),
        parameters={"mass": (1.0, 1.2), "stiffness": (4.0, 5.0), "damping": (0.3, 0.5)},
        states={"place": 0.0, "speed": 0.0},
        ports=ports,
        truth={"force": truth},
        right=right,
        inputs=lambda rng: {"t": 0.1 * np.arange(400), "push": held(rng, 400, 8, 4.0)},
        noise=noise,
        values=values or {},
    )


def _tank(truth, right, port="flow", values=None):
    """A tank that empties by itself in proportion to its level, filled by a pump."""
    ports = (
        SimulatorPort("flow", "m/s", {"level": "m"}),
        SimulatorPort("pump", "m/s", {"rate": "m/s"}),
    )

    def rate(t, x, u, p, ports):
        late = u["pump"] + ports.pump(t, {"rate": u["pump"]})
        return [p["gain"] * late - p["outflow"] * x[0] + ports.flow(t, {"level": x[0]})]

    return System(
        make=lambda n: Stepped(rate, lambda _t, x, _u, _p, _ports: x[0], ("level",), n),
        parameters={"gain": (1.0, 0.8), "outflow": (0.05, 0.08)},
        states={"level": 2.0},
        ports=ports,
        truth={port: truth},
        right=right,
        inputs=lambda rng: {"t": 0.5 * np.arange(400), "pump": 0.15 + held(rng, 400, 12, 0.12)},
        noise=0.004,
        values=values or {},
    )


def _two_masses(truth, right):
    """A motor that drives a load through a shaft; the angle of the load is seen."""
    ports = (SimulatorPort("coupling", "rad", {"twist": "rad"}), SimulatorPort("load", "N m", {"speed": "rad/s"}))

    def rate(t, x, u, p, ports):
        twist = x[0] - x[2] + ports.coupling(t, {"twist": x[0] - x[2]})
        torque = p["stiffness"] * twist + p["damping"] * (x[1] - x[3])
        drag = ports.load(t, {"speed": x[3]})
        return [x[1], (u["torque"] - 0.4 * x[1] - torque) / 0.1, x[3], (torque - p["friction"] * x[3] + drag) / 0.2]

    return System(
        make=lambda n: Stepped(
            rate, lambda _t, x, _u, _p, _ports: x[2], ("motor", "motor_speed", "angle", "speed"), 2 * n
        ),
        parameters={"stiffness": (20.0, 12.0), "damping": (0.2, 0.4), "friction": (0.3, 0.5)},
        states={"motor": 0.0, "motor_speed": 0.0, "angle": 0.0, "speed": 0.0},
        ports=ports,
        truth={"coupling": truth},
        right=right,
        inputs=lambda rng: {"t": 0.05 * np.arange(400), "torque": held(rng, 400, 16, 2.0)},
        noise=0.004,
        unit="rad",
    )


def _exchanger(truth, right):
    """A body that is heated and gives off heat to its surroundings; its age is an input."""
    ports = (SimulatorPort("heat", "K/s", {"excess": "K", "age": "h"}),)

    def rate(t, x, u, p, ports):
        return [p["gain"] * u["heater"] - p["loss"] * x[0] + ports.heat(t, {"excess": x[0], "age": u["age"]})]

    return System(
        make=lambda n: Stepped(rate, lambda _t, x, _u, _p, _ports: x[0], ("excess",), n),
        parameters={"gain": (1.0, 0.8), "loss": (0.1, 0.07)},
        states={"excess": 0.0},
        ports=ports,
        truth={"heat": truth},
        right=right,
        inputs=lambda rng: {
            "t": 1.0 * np.arange(400),
            "heater": 1.0 + held(rng, 400, 20, 0.8),
            "age": np.linspace(0.0, 100.0, 400),
        },
        noise=0.03,
        unit="K",
    )


def _carriage(truth, right):
    """A carriage that follows its command with a lag along a guide whose pitch is known; its scale is read."""
    ports = (SimulatorPort("scale", "mm", {"place": "mm", "pitch": "mrad"}),)

    def seen(t, x, _u, p, ports):
        pitch = 0.4 * np.sin(2.0 * np.pi * x[0] / 70.0) + 0.004 * x[0]  # of the guide, from an autocollimator
        return p["gain"] * x[0] + p["offset"] + ports.scale(t, {"place": x[0], "pitch": pitch})

    return System(
        make=lambda n: Stepped(lambda _t, x, u, p, _ports: [(u["command"] - x[0]) / p["lag"]], seen, ("place",), n),
        parameters={"gain": (1.0, 1.001), "lag": (0.2, 0.3), "offset": (0.1, 0.2)},
        states={"place": 0.0},
        ports=ports,
        truth={"scale": truth},
        right=right,
        inputs=lambda rng: {"t": 0.1 * np.arange(400), "command": held(rng, 400, 8, 100.0)},
        noise=0.002,
        unit="mm",
        values={"coefficient": 0.06},
    )


def _rigid_drive(truth, resembles):
    """A motor that drives a table as if its coupling were rigid; the angle of the table is seen."""
    ports = (
        SimulatorPort("shaft", "N m", {"angle": "rad", "speed": "rad/s"}),
        SimulatorPort("table", "rad", {"angle": "rad"}),
    )

    def rate(t, x, u, p, ports):
        torque = u["torque"] - p["friction"] * x[1] + ports.shaft(t, {"angle": x[0], "speed": x[1]})
        return [x[1], torque / p["inertia"]]

    return System(
        make=lambda n: Stepped(
            rate, lambda t, x, _u, _p, ports: x[0] + ports.table(t, {"angle": x[0]}), ("angle", "speed"), n
        ),
        parameters={"inertia": (0.3, 0.4), "friction": (0.5, 0.3)},
        states={"angle": 0.0, "speed": 0.0},
        ports=ports,
        truth={"table": truth},
        right=("resonance",),
        resembles=resembles,
        inputs=lambda rng: {"t": 0.05 * np.arange(400), "torque": held(rng, 400, 16, 2.0)},
        noise=0.004,
        unit="rad",
    )


def _ringing(period, ratio):
    """A table behind a coupling that twists: how far it is from the angle of the motor."""

    def make():
        last, state = [0.0, 0.0], np.zeros(2)  # time and angle; angle of the table and its speed
        turns = 2.0 * np.pi / period

        def value(t, signals):
            steps = 8  # Heun's method between the calls, in which the angle of the motor goes straight on
            h = (t - last[0]) / steps
            for n in range(steps):
                begin, end = (last[1] + (signals["angle"] - last[1]) * (n + k) / steps for k in (0, 1))
                a = np.array([state[1], turns**2 * (begin - state[0]) - 2.0 * ratio * turns * state[1]])
                later = state + h * a
                b = np.array([later[1], turns**2 * (end - later[0]) - 2.0 * ratio * turns * later[1]])
                state[:] = state + 0.5 * h * (a + b)
            last[:] = [t, signals["angle"]]
            return float(state[0]) - signals["angle"]

        return value

    return make


def _late(dead):
    def make():
        times, values = [], []

        def value(t, signals):
            times.append(t)
            values.append(signals["rate"])
            # The input is held for a row of half a second: what it was is looked up by its row.
            return values[max(int(np.searchsorted(times, t - dead + 1e-9)) - 1, 0)] - signals["rate"]

        return value

    return make


def _plain(function):
    return lambda: lambda _t, signals: function(signals)


def _creeping(size, tau):
    def make():
        state = [0.0, 0.0]

        def value(t, signals):
            step = max(t - state[0], 0.0)
            state[1] += (signals["place"] - state[1]) * -np.expm1(-step / tau)
            state[0] = max(t, state[0])
            return -size * state[1]

        return value

    return make


SYSTEMS = {
    "pendulum drag": _mass(
        0.004, _plain(lambda s: -0.25 * s["speed"] * abs(s["speed"])), ("quadratic drag of speed", "curve of speed")
    ),
    "saturation": _mass(
        0.004,
        _plain(lambda s: 2.0 * (s["place"] - np.clip(s["place"], -0.8, 0.8))),
        ("limited of place", "curve of place", "cubic of place"),
    ),
    "stiction": _mass(
        0.004,
        _plain(lambda s: -0.5 * np.tanh(s["speed"] / 0.05)),
        ("sign of speed", "limited of speed", "stick-slip of place"),
    ),
    "hardening spring": _mass(
        0.004, _plain(lambda s: -0.8 * s["place"] ** 3), ("cubic of place",), {"coefficient": -0.8}
    ),
    "creep": _mass(0.002, _creeping(1.5, 3.0), ("memory of place", "stick-slip of place", "memory of speed")),
    "dead time": _tank(_late(2.0), ("delay of rate",), port="pump"),
    "leaking tank": _tank(
        _plain(lambda s: -0.06 * np.sqrt(max(s["level"], 0.0))),
        ("curve of level", "square of level", "constant", "hinge of level", "limited of level", "quadratic drag"),
    ),
    "winding temperature": _tank(
        _plain(lambda s: -0.008 * s["level"] ** 2),
        ("square of level", "quadratic drag of level", "curve of level", "cubic of level"),
    ),
    "two at once": _mass(
        0.004,
        _plain(lambda s: -0.25 * s["speed"] * abs(s["speed"]) - 0.8 * s["place"] ** 3),
        ("quadratic drag of speed", "curve of speed", "cubic of place", "curve of place"),
    ),
    "backlash between two masses": _two_masses(
        _plain(lambda s: -float(np.clip(s["twist"], -0.05, 0.05))), ("dead zone of twist", "limited of twist")
    ),
    "fouling": _exchanger(
        _plain(lambda s: 0.0004 * s["age"] * s["excess"]), ("product of excess and age", "product of age and excess")
    ),
    "Abbe error": _carriage(_plain(lambda s: 0.06 * s["pitch"]), ("linear of pitch",)),
    # No form rings: what lags behind the angle of the motor is the nearest to it.
    "coupling resonance": _rigid_drive(
        _ringing(0.6, 0.1), ("delay of angle at table", "lag of angle at table", "memory of angle at table")
    ),
}
"""The twelve concealed effects, and a hardening spring."""
