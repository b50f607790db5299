"""Concealed effects: a simulator lacks one, its parameters were refitted so that they hide what they can, and a clean twin of each.

    python -m tests.diagnosis.table.concealed --seeds 1,2 --sizes 2,5 --out concealed.csv [--cases room,creep] [--workers 2]

It shares no line with the package: effects with a memory are integrated in time steps of their own. The simulator's parameters are
fitted to the recording by least squares before the table is written, as its user would have done; columns `d_NAME` are differences at
these values. Sizes are root mean squares of what the parameters leave of an effect, over the noise. Rows of a file that is there are
not run again.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq, least_squares
from scipy.signal import lfilter

from dbbstation.diagnosis.table.mismatch import find_mismatch
from dbbstation.inference.levels import Verdict
from dbbstation.tasks.tables import TableOptions, load_tables

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.inference.read_off import CauseFinding

    Array = NDArray[np.float64]
    Rng = np.random.Generator

ROWS = 600
FINER = 20
"""Time steps of a body in one row of a table."""


@dataclass(frozen=True, eq=False)
class Case:
    """An object, its simulator and what that lacks.

    Attributes:
        unit: of measured values, as it ends a column's name.
        columns: of the table, by name with unit; the first is the time.
        simulate: values of its parameters to what the simulator says, shape (n,).
        parameters: name and value of each, as they are.
        missing: what the simulator lacks, in any size, shape (n,).
        right: how right names begin; each that says the variable and the form, or what is the same in this recording.
        constant: time constant or dead time, in the unit of the time; zero where there is none.
        has_it: names that have it exactly.
    """

    unit: str
    columns: dict[str, Array]
    simulate: Callable[[Array], Array]
    parameters: dict[str, float]
    missing: Array
    right: tuple[str, ...]
    constant: float = 0.0
    has_it: tuple[str, ...] = ()


def _clock(row_s: float) -> Array:
    return np.arange(ROWS) * row_s


def _sines(rng: Rng, cycles: tuple[float, float], count: int) -> Array:
    at = np.linspace(0.0, 1.0, ROWS)
    parts = [
        rng.uniform(0.5, 1.0) * np.sin(2.0 * np.pi * rng.uniform(*cycles) * at + rng.uniform(0.0, 6.3))
        for _ in range(count)
    ]
    return np.sum(parts, axis=0)


def _switched(rng: Rng, levels: Sequence[float], changes: int) -> Array:
    at = np.sort(rng.choice(np.arange(5, ROWS - 5), changes, replace=False))
    chosen = rng.choice(len(levels), changes + 1)
    return np.asarray(levels, dtype=np.float64)[chosen[np.searchsorted(at, np.arange(ROWS), side="right")]]


def _follows(values: Array, row_s: float, constant_s: float) -> Array:
    """A body that follows, in small implicit steps; it begins at rest."""
    step = row_s / FINER
    fine = np.interp(np.arange((ROWS - 1) * FINER + 1) / FINER, np.arange(ROWS), values)
    share = step / (constant_s + step)
    state = lfilter([share], [1.0, share - 1.0], fine, zi=[(1.0 - share) * fine[0]])[0]
    return np.asarray(state[::FINER])


def _load_cell(rng: Rng) -> Case:
    """A load cell whose answer bends with the cube of the load."""
    load = 800.0 * _sines(rng, (2.0, 8.0), 3)
    return Case(
        "mm",
        {"t_s": _clock(0.1), "load_n": load, "room_c": 21.0 + 0.8 * _sines(rng, (0.5, 2.0), 2)},
        lambda p: p[0] * load / 1000.0 + p[1],
        {"compliance": 0.8, "zero": 0.1},
        (load / 1000.0) ** 3,
        ("curve over load_n", "curve over simulated_mm"),
    )


def _payload(rng: Rng) -> Case:
    q1, q2 = (np.radians(70.0 * _sines(rng, (2.0, 7.0), 2)) for _ in range(2))
    payload = _switched(rng, (0.0, 40.0, 80.0), 14)
    return Case(
        "mm",
        {"t_s": _clock(0.05), "q1_deg": np.degrees(q1), "q2_deg": np.degrees(q2), "payload_n": payload},
        lambda p: p[0] * np.sin(q1) + p[1] * np.sin(q1 + q2) + p[2],
        {"upper": 400.0, "lower": 350.0, "base": 120.0},
        payload * np.cos(q1),
        ("product of q1_deg and payload_n", "product of payload_n and q1_deg"),
    )


def _screw(rng: Rng) -> Case:
    place = 120.0 * _sines(rng, (3.0, 9.0), 2)
    oil = 22.0 + 6.0 * (1.0 - np.exp(-np.linspace(0.0, rng.uniform(1.0, 4.0), ROWS)))
    return Case(
        "mm",
        {"t_s": _clock(0.05), "slide_mm": place, "oil_c": oil},
        lambda p: p[0] * place + p[1],
        {"lead": 1.0, "zero": 0.0},
        np.sign(np.gradient(place)),
        ("hysteresis of slide_mm", "hysteresis of simulated_mm"),
    )


def _expansion(rng: Rng) -> Case:
    """A scale that grows with its oil, which the simulator does not know."""
    place = 300.0 * _sines(rng, (4.0, 11.0), 2)
    oil = 20.0 + 5.0 * _sines(rng, (0.5, 2.5), 2)
    return Case(
        "mm",
        {"t_s": _clock(0.2), "slide_mm": place, "oil_c": oil, "speed_rpm": np.abs(np.gradient(place)) * 40.0},
        lambda p: p[0] * place + p[1],
        {"lead": 1.0, "zero": 2.0},
        place * (oil - 20.0),
        ("product of slide_mm and oil_c", "product of oil_c and simulated_mm", "product of simulated_mm and oil_c"),
    )


def _encoder(rng: Rng) -> Case:
    """An encoder that is read twice per turn too far; its mounting is fitted."""
    turned = 900.0 * _sines(rng, (1.0, 4.0), 2)
    angle = np.radians(turned)
    return Case(
        "deg",
        {"t_s": _clock(0.02), "encoder_deg": np.mod(turned, 360.0), "torque_n_m": 3.0 * _sines(rng, (2.0, 9.0), 2)},
        lambda p: turned + p[0] * np.cos(angle) + p[1] * np.sin(angle) + p[2],
        {"eccentric_x": 0.3, "eccentric_y": -0.2, "zero": 1.0},
        np.cos(2.0 * angle + 0.6),
        ("twice per turn of encoder_deg", "curve over encoder_deg"),
    )


def _room(rng: Rng) -> Case:
    """A frame that follows the room after a while; the simulator has it follow at once."""
    row = float(rng.choice([0.5, 2.0]))
    room = 21.0 + 2.0 * _sines(rng, (1.5, 6.0), 3)
    constant = row * float(rng.uniform(15.0, 40.0))
    late = _follows(room, row, constant)
    load = 100.0 * _sines(rng, (3.0, 9.0), 2)
    return Case(
        "um",
        {"t_s": _clock(row), "room_c": room, "load_n": load},
        lambda p: p[0] * (room - 21.0) + p[1] * load + p[2],
        {"growth": 4.0, "compliance": 0.02, "zero": 0.0},
        late - room,
        ("memory of room_c",),
        constant,
        ("memory of room_c",),
    )


def _creep(rng: Rng) -> Case:
    """A load cell that creeps under loads that are put on and taken off."""
    row = float(rng.choice([0.1, 1.0]))
    load = _switched(rng, (0.0, 20.0, 50.0), 12)
    draught = 0.5 * _sines(rng, (0.5, 3.0), 2)
    constant = row * float(rng.uniform(12.0, 30.0))
    return Case(
        "n",
        {"t_s": _clock(row), "load_kg": load, "room_c": 20.0 + draught},
        lambda p: p[0] * load + p[1],
        {"gain": 9.81, "zero": 0.5},
        _follows(load, row, constant),
        ("memory of load_kg", "memory of simulated_n"),
        constant,
        ("memory of load_kg", "memory of simulated_n"),
    )


def _dead_time(rng: Rng) -> Case:
    row, rows_late = float(rng.choice([0.05, 0.5])), int(rng.integers(4, 12))
    valve = _switched(rng, (10.0, 30.0, 45.0, 80.0), 25)
    pressure = 3.0 + 0.3 * _sines(rng, (2.0, 6.0), 2)
    flow = valve * np.sqrt(pressure)
    late = np.concatenate([np.full(rows_late, flow[0]), flow[:-rows_late]])
    return Case(
        "l_min",
        {"t_s": _clock(row), "valve_percent": valve, "pressure_bar": pressure},
        lambda p: p[0] * flow + p[1],
        {"orifice": 0.4, "zero": 0.0},
        late - flow,
        ("dead time of simulated_l_min", "dead time of valve_percent", "memory of simulated_l_min", "lag of simulated"),
        rows_late * row,
        ("dead time of simulated_l_min",),
    )


def _sensor(rng: Rng) -> Case:
    """A heated body; the simulator knows it, and not the thermometer's own body."""
    row, body = 2.0, 2.0 * rng.uniform(25.0, 50.0)
    duty = _switched(rng, (0.0, 40.0, 90.0), 9)
    ambient = 20.0 + 1.0 * _sines(rng, (0.5, 2.0), 2)
    seen = _follows(duty, row, body)
    constant = row * float(rng.uniform(4.0, 9.0))
    return Case(
        "c",
        {"t_s": _clock(row), "duty_percent": duty, "ambient_c": ambient},
        lambda p: ambient + p[0] * _follows(duty, row, abs(p[1])),
        {"gain": 0.5, "time_constant": body},
        _follows(seen, row, constant) - seen,
        (
            "memory of simulated_c",
            "dead time of simulated_c",
            "lag of simulated_c",
            "memory of duty",
            "dead time of duty",
        ),
        constant,
        ("memory of simulated_c",),
    )


def _slow_body(rng: Rng) -> Case:
    """A spindle that grows with its speed, quickly and slowly; the simulator knows the quick part."""
    row = 5.0
    speed = _switched(rng, (0.0, 4.0, 8.0, 12.0), 10)
    quick = row * rng.uniform(3.0, 6.0)
    coolant = 20.0 + 0.4 * _sines(rng, (3.0, 12.0), 2)
    constant = quick * float(rng.uniform(5.0, 9.0))
    return Case(
        "um",
        {"t_s": _clock(row), "speed_krpm": speed, "coolant_c": coolant},
        lambda p: p[0] * _follows(speed, row, abs(p[1])) + p[2],
        {"growth": 1.5, "time_constant": quick, "zero": 0.0},
        _follows(speed, row, constant),
        ("memory of speed_krpm", "memory of simulated_um"),
        constant,
        ("memory of speed_krpm",),
    )


CASES: dict[str, Callable[[Rng], Case]] = {
    "load-cell": _load_cell,
    "payload": _payload,
    "screw": _screw,
    "expansion": _expansion,
    "encoder": _encoder,
    "room": _room,
    "creep": _creep,
    "dead-time": _dead_time,
    "sensor": _sensor,
    "slow-body": _slow_body,
}
NOISES = {"white": [1.0], "averaged": [1.0, 1.0, 1.0, 1.0, 1.0]}
"""Weights by which white noise is averaged."""
NOISE = 1e-3
"""Over the standard deviation of what a simulator says."""


def write(name: str, seed: int, noise: str, size: float, folder: Path) -> tuple[list[Path], TableOptions, Case, float]:
    """Write one table; the last value is the share of the effect that the parameters hide, in rms."""
    rng = np.random.default_rng([20261126, seed, list(CASES).index(name), list(NOISES).index(noise)])
    case = CASES[name](rng)
    true = np.array(list(case.parameters.values()))
    nominal = case.simulate(true)
    rows = np.convolve(rng.standard_normal(ROWS + len(NOISES[noise]) - 1), NOISES[noise], "valid")
    scale = NOISE * float(np.std(nominal))
    around = true + 1e-3 * np.maximum(np.abs(true), 1.0)
    shape = (case.missing - case.missing.mean()) / np.std(case.missing)

    def left(gain: float) -> tuple[Array, Array]:
        """What the fitted parameters leave of an effect of this size, and they."""
        fitted = least_squares(
            lambda p: (case.simulate(p) - nominal - gain * shape) / scale, around, x_scale=np.abs(around)
        )
        return nominal + gain * shape - case.simulate(fitted.x), fitted.x

    gain = 0.0
    if size:
        gain = float(brentq(lambda g: np.std(left(g)[0]) - size * scale, 0.0, 1e3 * size * scale, xtol=1e-3 * scale))
    measured = nominal + gain * shape + scale * rows / np.std(rows)
    fit = least_squares(lambda p: (case.simulate(p) - measured) / scale, around, x_scale=np.abs(around))
    simulated = case.simulate(fit.x)
    columns = {**case.columns, f"measured_{case.unit}": measured, f"simulated_{case.unit}": simulated}
    for k, parameter in enumerate(case.parameters):
        step = np.zeros(len(true))
        step[k] = 1e-4 * max(abs(fit.x[k]), 0.1)
        columns[f"d_{parameter}"] = (case.simulate(fit.x + step) - case.simulate(fit.x - step)) / (2.0 * step[k])
    path = folder / f"{name}-{seed}-{noise}-{size:g}.csv"
    np.savetxt(
        path, np.column_stack(list(columns.values())), fmt="%.9g", delimiter=",", header=",".join(columns), comments=""
    )
    hidden = float(1.0 - size * scale / gain) if gain else 0.0
    return [path], TableOptions(f"measured_{case.unit}", f"simulated_{case.unit}"), case, hidden


def answer(name: str, seed: int, noise: str, size: float) -> dict[str, object]:
    """What the program says of one table, as its user has it: right, ambiguous, nothing or wrong."""
    began = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        paths, options, case, hidden = write(name, seed, noise, size, Path(folder))
        found = find_mismatch(load_tables(paths, options).table)
    said = {v: [one.name for one in found.findings if one.verdict is v] for v in TOLD}
    claimed = said[Verdict.IDENTIFIED] + said[Verdict.HAPPENED]
    right = case.right if size else ()
    wrong = [one for one in claimed if not one.startswith(right or ("-",))]
    return {
        "case": name,
        "seed": seed,
        "noise": noise,
        "size": size,
        "hidden": f"{hidden:.2f}",
        "answer": _summed(said, right, wrong),
        "constant": f"{case.constant:.5g}" if size else "",
        "off_u": _off(found.findings, case) if size else "",
        **{str(v): "; ".join(names) for v, names in said.items()},
        "seconds": f"{time.process_time() - began:.1f}",
    }


TOLD = (Verdict.IDENTIFIED, Verdict.HAPPENED, Verdict.DOES_NOT_PREDICT, Verdict.AMBIGUOUS)


def _summed(said: dict[Verdict, list[str]], right: tuple[str, ...], wrong: list[str]) -> str:
    if wrong:
        return "wrong"
    for verdict, word in ((Verdict.IDENTIFIED, "right"), (Verdict.AMBIGUOUS, "ambiguous")):
        if right and any(one.startswith(right) for one in said[verdict]):
            return word
    if right and any(one.startswith(right) for one in said[Verdict.DOES_NOT_PREDICT]):
        return "does-not-predict"
    return "nothing"


def _off(findings: Sequence[CauseFinding], case: Case) -> str:
    """Standard uncertainties by which a claimed constant is off; empty where none is claimed."""
    for one in findings:
        if one.name in case.has_it and one.verdict in TOLD:
            value = one.values["dead time" if "dead time" in one.name else "time constant"]
            return f"{(value.value - case.constant) / value.uncertainty:.2f}"
    return ""


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--seeds", default="1,2")
    options.add_argument("--sizes", default="0,2,5")
    options.add_argument("--cases", default=",".join(CASES))
    options.add_argument("--out", type=Path, required=True)
    options.add_argument("--workers", type=int, default=os.cpu_count())
    chosen = options.parse_args()
    rows: list[dict[str, str]] = []
    if chosen.out.exists():
        with chosen.out.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    known = {(row["case"], int(row["seed"]), row["noise"], float(row["size"])) for row in rows}
    wanted = [
        (case, seed, noise, size)
        for seed in map(int, chosen.seeds.split(","))
        for size in map(float, chosen.sizes.split(","))
        for case in chosen.cases.split(",")
        for noise in NOISES
    ]
    with ProcessPoolExecutor(chosen.workers) as pool:
        for done in as_completed([pool.submit(answer, *one) for one in wanted if one not in known]):
            rows.append({name: str(value) for name, value in done.result().items()})
            with chosen.out.open("w", encoding="utf-8", newline="") as file:
                writer = csv.DictWriter(file, list(rows[0]))
                writer.writeheader()
                writer.writerows(rows)
    for size in dict.fromkeys(row["size"] for row in rows):
        for case in dict.fromkeys(row["case"] for row in rows):
            own = [row for row in rows if row["case"] == case and row["size"] == size]
            counts = {
                word: sum(row["answer"] == word for row in own) for word in dict.fromkeys(r["answer"] for r in own)
            }
            hidden = np.mean([float(row["hidden"]) for row in own])
            said = ", ".join(f"{word} {count}" for word, count in counts.items())
            off = ", ".join(row["off_u"] for row in own if row["off_u"])
            print(f"size {float(size):g} {case:10} hidden {hidden:4.0%}: {said}{f'; off by {off} u' * bool(off)}")  # noqa: T201


if __name__ == "__main__":
    sys.exit(main())
