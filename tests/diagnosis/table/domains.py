"""Tables of other fields with a known effect, and twins without it: recall, precision, corrections and coverage of u.

    python -m tests.diagnosis.table.domains --seeds 1,2 --out docs/validation/tables-domains.json [--what effect,twin]

A tank, a gyro, a sensor, a valve, a stop, a magnet, a beam in a warm room, a joint, a screw, a spring, a barometer, a scale of a ball bar, a worn
pump, a pendulum in air, a cell under load, a crane's rope, a photometer, a tide gauge. Rows, sizes, noise and times are drawn; half of the ordered tables have irregular times. Constants have their true values, so that u is tested.
Results are kept in the file, and tables that are there are not run again.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from dbbstation.diagnosis.table.data import Table
from dbbstation.diagnosis.table.mismatch import Mismatch, find_mismatch
from dbbstation.diagnosis.table.units import meaning_of
from dbbstation.inference.channel import Kind, Variable
from dbbstation.inference.levels import TIME, FollowsAnswer
from tests.diagnosis.table.levels_study import interval, stored_table

Values = NDArray[np.float64]
SIMULATED = "simulated_mm"


@dataclass
class Scene:
    """What a table is made of.

    Attributes:
        effect: what the simulation lacks.
        follows: variables that are right to name, any of them.
        laws: beginnings of names that are right.
        true: value of a constant by a word in its name.
        parts: beginnings of names of a true part, which is not wrong and is no whole answer.
    """

    columns: dict[str, Values]
    simulated: Values
    effect: Values
    follows: frozenset[str]
    laws: tuple[str, ...]
    true: dict[str, float] = field(default_factory=dict)
    derivatives: dict[str, Values] = field(default_factory=dict)
    parts: tuple[str, ...] = ()


def smooth(rng: np.random.Generator, rows: int, width: float) -> Values:
    """Draw a smooth signal of mean zero and deviation one."""
    found = gaussian_filter1d(rng.standard_normal(rows + 8 * int(width)), width)[4 * int(width) :][:rows]
    return np.asarray((found - found.mean()) / found.std())


def late(values: Values, t: Values, constant: float) -> Values:
    """Return what follows with a time constant, by 20 small steps a row along straight lines between rows."""
    found, now = [values[0]], values[0]
    for k in range(1, len(t)):
        fade = np.exp(-(t[k] - t[k - 1]) / 20.0 / constant)
        for share in (np.arange(20) + 0.5) / 20.0:
            now = fade * now + (1.0 - fade) * (values[k - 1] + share * (values[k] - values[k - 1]))
        found.append(now)
    return np.array(found)


def gathered(values: Values, t: Values) -> Values:
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(t))])


def dead(values: Values, half: float) -> Values:
    return values - np.clip(values, -half, half)


def clip_above(rng: np.random.Generator, t: Values) -> Scene:
    x = 40.0 + 10.0 * smooth(rng, len(t), 12)
    limit = float(np.quantile(x, rng.uniform(0.7, 0.9)))
    columns = {"pump_bar": 3.0 + smooth(rng, len(t), 20), "room_c": 21.0 + smooth(rng, len(t), 40)}
    return Scene(
        columns,
        x,
        np.minimum(x, limit) - x,
        frozenset({SIMULATED}),
        ("upper knee of", "saturation of"),
        {"knee": limit},
    )


def clip_both(rng: np.random.Generator, t: Values) -> Scene:
    x = 10.0 * smooth(rng, len(t), 12)
    low, high = np.quantile(x, rng.uniform(0.1, 0.25)), np.quantile(x, rng.uniform(0.75, 0.9))
    columns = {"pump_bar": 3.0 + smooth(rng, len(t), 20), "room_c": 21.0 + smooth(rng, len(t), 40)}
    return Scene(
        columns,
        x,
        np.clip(x, low, high) - x,
        frozenset({SIMULATED}),
        ("saturation of", "upper knee of", "lower knee of"),
    )


def valve(rng: np.random.Generator, t: Values) -> Scene:
    u = 3.0 * smooth(rng, len(t), 10)
    half = float(rng.uniform(0.15, 0.4) * np.abs(u).max())
    columns = {"command_v": u, "oil_c": 40.0 + 3.0 * smooth(rng, len(t), 40)}
    return Scene(
        columns,
        5.0 * u,
        5.0 * (dead(u, half) - u),
        frozenset({"command_v", SIMULATED}),
        ("dead zone of",),
        {"half width": half},
    )


def stop(rng: np.random.Generator, t: Values) -> Scene:
    x, force = 20.0 * smooth(rng, len(t), 10), 50.0 * smooth(rng, len(t), 14)
    half = float(rng.uniform(0.2, 0.5) * np.abs(x).max())
    columns = {"travel_um": x, "load_n": force}
    return Scene(
        columns,
        0.3 * force,
        0.5 * dead(x, half),
        frozenset({"travel_um"}),
        ("dead zone of",),
        {"half width": half, "slope": 0.5},
    )


def magnet(rng: np.random.Generator, t: Values) -> Scene:
    i = 4.0 * smooth(rng, len(t), 10)
    width = float(rng.uniform(0.3, 0.7) * np.abs(i).max())
    columns = {"coil_a": i, "speed_rpm": 900.0 + 100.0 * smooth(rng, len(t), 20)}
    effect = 2.0 * (width * np.tanh(i / width) - i)
    return Scene(columns, 2.0 * i, effect, frozenset({"coil_a", SIMULATED}), ("saturation of", "curve over"))


def tank(rng: np.random.Generator, t: Values) -> Scene:
    flow = np.maximum(
        2.0 + np.repeat(rng.integers(0, 4, len(t) // 8 + 1), 8)[: len(t)] + 0.1 * smooth(rng, len(t), 3), 0.0
    )
    columns = {"leak_l_min": flow, "room_c": 20.0 + smooth(rng, len(t), 30)}
    zero, rate = float(rng.uniform(0.0, 3.0)), -0.05
    return Scene(
        columns, 300.0 + 20.0 * smooth(rng, len(t), 20), rate * gathered(flow - zero, t),
        frozenset({"leak_l_min"}), ("integral of leak",), {"rate": rate, "zero": zero},
    )  # fmt: skip


def gyro(rng: np.random.Generator, t: Values) -> Scene:
    rate = 5.0 * smooth(rng, len(t), 8)
    columns = {"rate_v": rate, "supply_bar": 5.0 + 0.1 * smooth(rng, len(t), 30)}
    gain, zero = 0.04, float(rng.normal(0.0, 2.0))
    return Scene(
        columns,
        gathered(rate, t),
        gain * gathered(rate + zero, t),
        frozenset({"rate_v", SIMULATED}),
        ("integral of rate", "linear in simulated"),
        {"rate": gain},
        parts=("drift with",),  # by the bias
    )


def warming(rng: np.random.Generator, t: Values) -> Scene:
    oil = 30.0 + 4.0 * np.repeat(rng.standard_normal(len(t) // 15 + 1), 15)[: len(t)]
    constant = float((t[-1] - t[0]) / rng.uniform(12.0, 30.0))
    columns = {"oil_c": oil, "place_um": 100.0 * smooth(rng, len(t), 6)}
    effect = 0.8 * (late(oil, t, constant) - 30.0)
    return Scene(
        columns,
        2.0 * smooth(rng, len(t), 9),
        effect,
        frozenset({"oil_c"}),
        ("memory of oil",),
        {"time constant": constant, "gain": 0.8},
    )


def joint(rng: np.random.Generator, t: Values) -> Scene:
    angle = smooth(rng, len(t), 9)
    speed = np.gradient(angle, t)
    size = 0.3
    columns = {"joint_rad": angle, "speed_rad_s": speed}
    return Scene(
        columns, 0.2 * speed / speed.std(), size * np.tanh(speed / (0.05 * np.abs(speed).max())), frozenset({"joint_rad", "speed_rad_s", SIMULATED}),
        ("friction of joint", "hysteresis of joint", "saturation of speed", f"saturation of {SIMULATED}", f"hysteresis of {SIMULATED}"),
        {"size": size, "half width": size, "limit": size},
    )  # fmt: skip


def screw(rng: np.random.Generator, t: Values) -> Scene:
    x = np.cumsum(np.abs(rng.normal(1.0, 0.2, len(t))))
    pitch = float(rng.uniform(7.0, 14.0))
    phase = 2.0 * np.pi * x / pitch
    effect = np.cos(phase) + 0.5 * np.cos(2.0 * phase + 1.0) + 0.35 * np.sin(3.0 * phase)
    columns = {"way_mm": x, "room_c": 20.0 + smooth(rng, len(t), 30)}
    return Scene(columns, x, effect, frozenset({"way_mm", SIMULATED}), ("wave over",))


def spring(rng: np.random.Generator, t: Values) -> Scene:
    x = 10.0 * smooth(rng, len(t), 7)
    columns = {"stretch_um": x, "spin_rpm": 100.0 + 9.0 * smooth(rng, len(t), 12)}
    return Scene(
        columns,
        2.0 * x,
        0.002 * x**3,
        frozenset({"stretch_um", SIMULATED}),
        ("curve over stretch", f"curve over {SIMULATED}"),
        {},
        {"stiffness": x},
    )


def growth(rng: np.random.Generator, t: Values) -> Scene:
    x, room = rng.uniform(0.0, 500.0, len(t)), 20.0 + 3.0 * smooth(rng, len(t), 25)
    columns = {"place_um": x, "room_c": room}
    return Scene(
        columns, x, 0.0117 * x * (room - 20.0), frozenset({"place_um", "room_c", SIMULATED}), ("product of place", "product of room", "linear in", f"product of {SIMULATED}"),
        {"size": 0.0117},
    )  # fmt: skip


def barometer(rng: np.random.Generator, t: Values) -> Scene:
    pressure, height = 1000.0 + 12.0 * rng.standard_normal(len(t)), rng.uniform(0.0, 800.0, len(t))
    columns = {"pressure_hpa": pressure, "height_m": height}
    return Scene(
        columns,
        300.0 + 0.1 * height,
        0.27 * (pressure - 1000.0),
        frozenset({"pressure_hpa"}),
        ("linear in pressure",),
        {"size": 0.27},
    )


def ball_bar(rng: np.random.Generator, t: Values) -> Scene:
    angle = np.linspace(0.0, 720.0, len(t)) % 360.0
    effect = np.cos(np.radians(angle - rng.uniform(0.0, 360.0)))
    columns = {"angle_deg": angle, "feed_v": 2.0 + 0.1 * smooth(rng, len(t), 9)}
    return Scene(columns, 100.0 + 0.0 * angle, effect, frozenset({"angle_deg"}), ("once per turn of angle",))


def pump(rng: np.random.Generator, t: Values) -> Scene:
    """Head of a pump whose worn rings let water back: the wheel moves more than is delivered, so the head falls with the flow."""
    flow, speed = 60.0 + 15.0 * smooth(rng, len(t), 10), 1450.0 + 60.0 * smooth(rng, len(t), 25)
    fall, back = 0.004, float(rng.uniform(2.0, 6.0))
    columns = {"flow_l_min": flow, "speed_rpm": speed, "water_c": 15.0 + smooth(rng, len(t), 40)}
    simulated = 40.0 * (speed / 1450.0) ** 2 - fall * flow**2
    return Scene(
        columns,
        simulated,
        -2.0 * fall * back * flow,
        frozenset({"flow_l_min"}),
        ("linear in flow",),
        {"slope": 2.0 * fall * back},
    )


def pendulum(rng: np.random.Generator, t: Values) -> Scene:
    """Acceleration of a pendulum in air, simulated without drag, which grows with the square of the speed; by 50 steps of Euler and Cromer a row."""
    drag, state, rows = float(rng.uniform(0.05, 0.2)), [float(rng.uniform(0.8, 1.4)), 0.0], []
    for step in np.diff(t, prepend=t[0]).tolist():
        for _ in range(50):
            state[1] -= step / 50.0 * (1.3 * np.sin(state[0]) + drag * abs(state[1]) * state[1])
            state[0] += step / 50.0 * state[1]
        rows.append(tuple(state))
    angle, rate = np.array(rows).T
    columns = {"swing_rad": angle, "rate_rad_s": rate, "room_c": 20.0 + smooth(rng, len(t), 40)}
    return Scene(
        columns,
        -1.3 * np.sin(angle),
        -drag * np.abs(rate) * rate,
        frozenset({"rate_rad_s", "swing_rad"}),
        ("drag of rate", "curve over rate"),
        {"coefficient": drag},
    )


def battery(rng: np.random.Generator, t: Values) -> Scene:
    """Voltage of a cell under load, simulated with a resistance alone: charge that moves slowly makes it sag late."""
    load = 5.0 * np.repeat(rng.uniform(0.0, 1.0, len(t) // 12 + 1), 12)[: len(t)]
    charge, constant = 100.0 - 0.01 * gathered(load, t), float((t[-1] - t[0]) / rng.uniform(12.0, 30.0))
    columns = {"load_a": load, "charge_pct": charge, "cell_c": 25.0 + smooth(rng, len(t), 40)}
    effect = -0.03 * (late(load, t, constant) - load[0])
    simulated = 3.2 + 0.009 * charge - 0.02 * load
    true = {"time constant": constant, "gain": 0.03}
    return Scene(columns, simulated, effect, frozenset({"load_a"}), ("memory of load",), true)


def rope(rng: np.random.Generator, t: Values) -> Scene:
    """Height of a crane's hook, simulated with a rope that does not stretch: it stretches with load times free length."""
    load, free = rng.uniform(0.0, 50.0, len(t)), 20.0 + 6.0 * smooth(rng, len(t), 15)
    columns = {"load_kn": load, "rope_m": free, "wind_m_s": 5.0 + smooth(rng, len(t), 20)}
    laws = ("product of load", "product of rope", f"product of {SIMULATED}", "linear in")
    return Scene(columns, -1000.0 * free, -0.3 * load * free, frozenset({"load_kn", "rope_m", SIMULATED}), laws)


def stray_light(rng: np.random.Generator, t: Values) -> Scene:
    """A photometer reads the absorbance of a dye. Stray light bends high values; the simulation has none."""
    dye = rng.uniform(0.0, 1.0, len(t))
    share = float(rng.uniform(0.01, 0.05))
    effect = -1000.0 * (np.log10((10.0 ** (-2.0 * dye) + share) / (1.0 + share)) + 2.0 * dye)
    columns = {"dye_g_l": dye, "cell_c": 25.0 + smooth(rng, len(t), 30)}
    return Scene(
        columns, 2000.0 * dye, effect, frozenset({"dye_g_l", SIMULATED}), ("curve over dye", "curve over simulated")
    )


def gauge(rng: np.random.Generator, t: Values) -> Scene:
    """Level of a tide gauge, simulated as outside: its well follows late."""
    outside, constant = 800.0 * smooth(rng, len(t), 9), float((t[-1] - t[0]) / rng.uniform(20.0, 40.0))
    columns = {"wind_m_s": 6.0 + 2.0 * smooth(rng, len(t), 12), "air_hpa": 1010.0 + 5.0 * smooth(rng, len(t), 25)}
    laws, true = ("memory of simulated", "lag of simulated"), {"time constant": constant}
    return Scene(columns, outside, late(outside, t, constant) - outside, frozenset({SIMULATED}), laws, true)


SCENES: dict[str, tuple[str, Callable[[np.random.Generator, Values], Scene]]] = {
    "clip above": ("static", clip_above),
    "clip both": ("static", clip_both),
    "valve": ("static", valve),
    "stop": ("static", stop),
    "magnet": ("static", magnet),
    "screw": ("static", screw),
    "growth": ("static", growth),
    "barometer": ("static", barometer),
    "ball bar": ("static", ball_bar),
    "joint": ("static", joint),
    "tank": ("memory", tank),
    "gyro": ("memory", gyro),
    "warming": ("memory", warming),
    "spring": ("concealed", spring),
    "pump": ("static", pump),
    "pendulum": ("static", pendulum),
    "battery": ("memory", battery),
    "rope": ("static", rope),
    "stray light": ("static", stray_light),
    "gauge": ("memory", gauge),
}
UNORDERED = frozenset({"barometer"})
NOISES = ("white", "slow", "long tails", "rounded", "grows")
ROWS = (60, 120, 250, 500, 900, 2000)
ODDS_OF_ROWS = (0.15, 0.25, 0.25, 0.2, 0.1, 0.05)
SIZES = (1.5, 3.0, 8.0)
"""Deviation of the effect over that of the noise."""


def noise_of(rng: np.random.Generator, kind: str, scene: Scene) -> Values:
    """Draw noise of deviation about one."""
    rows = len(scene.effect)
    white = rng.standard_normal(rows + 50)
    if kind == "slow":
        return np.asarray(0.8 * lfilter([1.0], [1.0, -0.6], white)[50:])
    if kind == "long tails":
        return rng.standard_t(4, rows) / np.sqrt(2.0)
    if kind == "grows":
        other = next(iter(scene.columns.values()))
        return white[50:] * (0.5 + (other - other.min()) / np.ptp(other))
    return white[50:]


def made(name: str, seed: int, *, effect: bool) -> tuple[Table, Scene, dict[str, object]]:
    """Return a table, its truth, and how it was drawn."""
    rng = np.random.default_rng([20261128, list(SCENES).index(name), seed])
    rows = int(rng.choice(ROWS, p=ODDS_OF_ROWS))
    rows = max(rows, 120) if SCENES[name][0] == "memory" else rows
    steps = rng.uniform(0.3, 1.7, rows) if (irregular := bool(rng.integers(2))) else np.ones(rows)
    t = np.cumsum(steps) * 0.5
    scene = SCENES[name][1](rng, t)
    kind, size = str(rng.choice(NOISES)), float(rng.choice(SIZES))
    sigma = float(scene.effect.std()) / size
    measured = scene.simulated + sigma * noise_of(rng, kind, scene) + 0.5 * sigma
    measured += scene.effect if effect else 0.0
    if kind == "rounded":
        measured = np.round(measured / sigma) * sigma
    clock = None if name in UNORDERED else Variable("t_s", "s", Kind.TIME, t)
    variables = tuple(
        Variable(each, (m := meaning_of(each)).unit, m.kind, values, m.period) for each, values in scene.columns.items()
    )
    table = Table(
        measured, scene.simulated, "mm", SIMULATED, variables if clock is None else (clock, *variables),
        scene.derivatives, scene.columns, (slice(0, rows),), ("run",), clock,
    )  # fmt: skip
    return table, scene, {"rows": rows, "noise": kind, "size": size, "irregular": irregular}


def answer(name: str, seed: int, what: str) -> dict[str, object]:
    """What the program says of one table."""
    table, scene, drawn = made(name, seed, effect=what == "effect")
    began = time.process_time()
    found = find_mismatch(table)
    levels = found.levels
    located = [one for one in levels.follows if one.answer is FollowsAnswer.FOLLOWS]
    named = [{v for each in one.variables for v in (*each, *one.or_variables)} for one in located]
    laws = sorted({law for one in located if one.form for law in one.form.names})
    truth = scene.follows if what == "effect" else frozenset()
    return {
        "kind": name,
        "group": SCENES[name][0],
        "seed": seed,
        "what": what,
        **drawn,
        "differs": str(levels.differs.answer),
        "follows": [one.name for one in located],
        "others": [f"{one.answer}: {one.name}" for one in levels.follows if one not in located],
        "right": any(one & truth for one in named),
        "wrong": any(not one & (truth | {TIME}) for one in named),
        "laws": laws,
        "right_law": any(law.startswith(scene.laws) for law in laws) and what == "effect",
        "wrong_law": any(not law.startswith((*scene.laws, *scene.parts)) or what != "effect" for law in laws),
        "false_ruled_out": any(str(one.verdict) == "ruled-out" and one.name.startswith(scene.laws) for one in found.findings),
        "claimed": {str(v): [one.name for one in found.findings if one.verdict is v] for v in {one.verdict for one in found.findings}},
        "off_u": off_u(found, scene, laws) if what == "effect" else {},
        "left": _left(found, scene) if what == "effect" and levels.correction else None,
        "correction": levels.correction,
        "seconds": round(time.process_time() - began, 1),
    }  # fmt: skip


def off_u(found: Mismatch, scene: Scene, laws: list[str]) -> dict[str, float]:
    """Standard uncertainties by which constants of right, named laws are off."""
    off = {}
    for one in found.findings:
        if one.name in laws and one.name.startswith(scene.laws):
            for name, value in one.values.items():
                true = scene.true.get(name)
                if true is not None and value.uncertainty > 0.0:
                    off[f"{one.name}: {name}"] = round((abs(value.value) - abs(true)) / value.uncertainty, 2)
    return off


def _left(found: Mismatch, scene: Scene) -> float:
    """Share of the true effect that is left after the correction, both about their means."""
    wrong = found.correction - scene.effect
    return round(float(np.std(wrong) / np.std(scene.effect)), 3)


def figures(rows: list[dict[str, object]]) -> dict[str, list[object]]:
    """Rates, each with how many of how many and its interval."""

    def rate(what: str, holds: Callable[[dict[str, object]], bool], group: str = "") -> list[object]:
        own = [r for r in rows if r["what"] == what and group in ("", r["group"])]
        return [sum(map(holds, own)), len(own), interval(sum(map(holds, own)), len(own))]

    found: dict[str, list[object]] = {
        "twin: yes": rate("twin", lambda r: r["differs"] == "yes"),
        "twin: a class follows": rate("twin", lambda r: bool(r["follows"])),
        "twin: a law is named": rate("twin", lambda r: bool(r["laws"])),
        "effect: no": rate("effect", lambda r: r["differs"] == "no"),
        "effect: yes": rate("effect", lambda r: r["differs"] == "yes"),
        "effect: right class": rate("effect", lambda r: bool(r["right"])),
        "effect: wrong class": rate("effect", lambda r: bool(r["wrong"])),
        "effect: right law": rate("effect", lambda r: bool(r["right_law"])),
        "effect: wrong law": rate("effect", lambda r: bool(r["wrong_law"])),
        "effect: right law is ruled out, none named": rate("effect", lambda r: bool(r["false_ruled_out"] and not r["right_law"])),
        "effect: correction leaves less than a third": rate("effect", lambda r: r["left"] is not None and float(str(r["left"])) < 1 / 3),
    }  # fmt: skip
    for group in ("memory", "concealed"):
        found[f"{group}: right law"] = rate("effect", lambda r: bool(r["right_law"]), group)
    off = [abs(value) for r in rows for value in (r["off_u"] if isinstance(r["off_u"], dict) else {}).values()]
    within = sum(one <= 2.0 for one in off)
    found["constants within 2 u"] = [within, len(off), interval(within, len(off))]
    return found


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--seeds", default="1,2")
    options.add_argument("--what", default="effect,twin")
    options.add_argument("--kinds", default=",".join(SCENES))
    options.add_argument("--out", type=Path, required=True)
    options.add_argument("--before", type=Path, help="results of the same tables of an earlier version")
    chosen = options.parse_args()
    stored = json.loads(chosen.out.read_text(encoding="utf-8")) if chosen.out.exists() else {"tables": []}
    rows: list[dict[str, object]] = stored["tables"]
    known = {(r["kind"], r["seed"], r["what"]) for r in rows}
    for seed in map(int, chosen.seeds.split(",")):
        for what in chosen.what.split(","):
            for name in chosen.kinds.split(","):
                if (name, seed, what) not in known:
                    rows.append(answer(name, seed, what))
                    chosen.out.write_text(json.dumps(_stored(rows), indent=1) + "\n", encoding="utf-8")
    if chosen.before is not None:
        keys = {(r["kind"], r["seed"], r["what"]) for r in rows}
        earlier = json.loads(chosen.before.read_text(encoding="utf-8"))
        same = figures([r for r in earlier["tables"] if (r["kind"], r["seed"], r["what"]) in keys])
        stored = _stored(rows)
        stored["columns"] = ["tables", "of", "95 % interval", f"at {earlier['commit']}"]
        stored["figures"] = {name: [*row, f"{same[name][0]} of {same[name][1]}"] for name, row in figures(rows).items()}
        chosen.out.write_text(json.dumps(stored, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(figures(rows), indent=1))  # noqa: T201


def _stored(rows: list[dict[str, object]]) -> dict[str, object]:
    seeds = ",".join(sorted({str(row["seed"]) for row in rows}, key=int))
    return stored_table(
        rows,
        figures(rows),
        question="Are effects in tables of other fields located, named, sized and corrected, and is nothing found in their twins?",
        data=f"{len(rows)} tables of {len(SCENES)} kinds; 60 to 2,000 rows, effects of 1.5 to 8 times the noise, five kinds of noise.",
        command=f"python -m tests.diagnosis.table.domains --seeds {seeds} --out docs/validation/tables-domains.json",
        limits="Effects and names are of the same hand as the program.",
    )


if __name__ == "__main__":
    main()
