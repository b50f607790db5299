"""Tables of a second origin in which nothing is missing: other objects, other noise, written to a file and read as a user's are.

    python -m tests.diagnosis.table.other_nulls --count 6 --seed 1 --out other-nulls.csv [--kinds pink,held] [--workers 2]
    python -m tests.diagnosis.table.other_nulls --count 2 --seed 5 --files 10 --set inference.coloured.SHORTEST_OF_ALL=8 --out short-8.csv

With `--files` each table has so many runs, with `--set` a constant of the program another value.

It shares no line with `nulls`. Four objects: a robot along a path, a heated tank, a spindle on a test bench, poses that a laser
tracker visits. Half of the tables bring derivatives of the simulated value. Rows of a file that is there are not run again.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, filtfilt, medfilt, sosfilt

from dbbstation.diagnosis.table.mismatch import find_mismatch
from dbbstation.inference.levels import Verdict
from dbbstation.tasks.tables import TableOptions, load_tables

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Recorded:
    """What a recording says beside the measured value.

    Attributes:
        time: of the rows, rising.
        simulated: value.
        follows: what the variance of a noise may follow, from 0 to 1.
        columns: variables and derivatives, by name with unit.
        clock: name of the time column.
        unit: of measured and simulated values.
    """

    time: NDArray[np.float64]
    simulated: NDArray[np.float64]
    follows: NDArray[np.float64]
    columns: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    clock: str = "t_s"
    unit: str = "mm"


Rng = np.random.Generator


def _robot(rng: Rng, rows: int, at: NDArray[np.float64]) -> Recorded:
    knots = np.linspace(0.0, 1.0, int(rng.integers(6, 16)))
    joints = {f"q{k}_deg": CubicSpline(knots, rng.uniform(-120.0, 120.0, len(knots)))(at) for k in (1, 2, 3)}
    q1, q2, q3 = (np.radians(one) for one in joints.values())
    reach = 400.0 * np.cos(q2) + 350.0 * np.cos(q2 + q3)
    columns = joints | {"payload_n": np.where(at < rng.uniform(0.3, 0.7), 20.0, 60.0)}
    if rng.random() < 0.5:
        columns["d_link"] = np.cos(q2)
        columns["d_base"] = np.sin(q1)
    return Recorded(at * rows * 0.02, reach, np.abs(np.sin(q2)), columns)


def _tank(rng: Rng, rows: int, at: NDArray[np.float64]) -> Recorded:
    duty = rng.uniform(0.0, 100.0, 12)[np.minimum((at * 12).astype(int), 11)]
    room = 20.0 + 3.0 * np.sin(2.0 * np.pi * rng.uniform(0.5, 2.0) * at + 1.0)
    body, fade = np.empty(rows), 0.0
    for k in range(rows):
        fade += (0.4 * duty[k] - fade) * min(30.0 / rows, 1.0)
        body[k] = room[k] + fade
    columns = {
        "duty_percent": duty,
        "room_c": room,
        "pump_rpm": 1000.0 + 200.0 * rng.standard_normal(4)[(at * 3.99).astype(int)],
    }
    if rng.random() < 0.5:
        columns["d_gain"] = body - room
        columns["d_start"] = np.exp(-at * 30.0)
    return Recorded(at * rows * 5.0, body, duty / 100.0, columns, unit="c")


def _spindle(rng: Rng, rows: int, at: NDArray[np.float64]) -> Recorded:
    """Speeds in a staircase, a load that switches at random, a saw tooth of positions."""
    speed = np.repeat(rng.permutation(np.arange(1, 9)) * 500.0, rows // 8 + 1)[:rows]
    load = np.repeat(np.sign(rng.standard_normal(rows // 15 + 1)), 15)[:rows] * 50.0
    place = 80.0 * np.abs(2.0 * ((at * rng.uniform(2.0, 7.0)) % 1.0) - 1.0)
    angle = np.cumsum(speed) * 0.006 % 360.0
    columns = {"speed_rpm": speed, "load_n": load, "slide_mm": place, "spindle_deg": angle}
    torque = 0.02 * load + 1e-4 * speed + 0.01 * place
    if rng.random() < 0.5:
        columns["d_viscous"] = speed / 1000.0
    return Recorded(at * rows * 0.004, torque, np.abs(load - load.min()) / (np.ptp(load) or 1.0), columns, unit="n_m")


def _poses(rng: Rng, rows: int, at: NDArray[np.float64]) -> Recorded:
    x, y, z = (rng.uniform(-500.0, 500.0, rows) for _ in range(3))
    columns = {"x_mm": x, "y_mm": y, "z_mm": z, "hall_c": 20.0 + 2.0 * at + 0.1 * rng.standard_normal(rows)}
    distance = np.sqrt((x - 900.0) ** 2 + y**2 + z**2)
    if rng.random() < 0.5:
        columns["d_x0"] = (x - 900.0) / distance
        columns["d_scale"] = distance
    return Recorded(at * rows * 0.01, distance, np.abs(x) / 500.0, columns, clock="t_h")


OBJECTS = (_robot, _tank, _spindle, _poses)

Noise = Callable[[Rng, Recorded], "NDArray[np.float64]"]


def _butter(rng: Rng, seen: Recorded) -> NDArray[np.float64]:
    """A zero-phase low-pass of second to fourth order, as logging software has, and a little white noise."""
    b, a = butter(int(rng.integers(2, 5)), float(rng.uniform(0.02, 0.3)))
    slow = filtfilt(b, a, rng.standard_normal(len(seen.time) + 600))[300:-300]
    return slow / np.std(slow) + float(rng.choice([0.0, 0.03, 0.2])) * rng.standard_normal(len(slow))


def _smoothed(rng: Rng, seen: Recorded) -> NDArray[np.float64]:
    noise, fade = rng.standard_normal(len(seen.time) + 500), float(rng.uniform(0.05, 0.4))
    for _ in range(2):
        last = 0.0
        for k, value in enumerate(noise):
            last = noise[k] = last + fade * (value - last)
    return noise[500:]


def _pink(rng: Rng, seen: Recorded) -> NDArray[np.float64]:
    """Power as one over the frequency, to the power 0.7 to 1.3."""
    length = 4 * len(seen.time)
    spectrum = np.fft.rfft(rng.standard_normal(length))
    spectrum[1:] *= np.arange(1, len(spectrum)) ** (-0.5 * rng.uniform(0.7, 1.3))
    spectrum[0] = 0.0
    return np.fft.irfft(spectrum)[: len(seen.time)]


def _coarse(rng: Rng, seen: Recorded) -> NDArray[np.float64]:
    step = float(rng.uniform(0.8, 2.5))
    return np.round(rng.standard_normal(len(seen.time)) / step) * step + 0.05 * rng.standard_normal(len(seen.time))


def _by_load(rng: Rng, seen: Recorded) -> NDArray[np.float64]:
    """Its size follows a variable, by a power that no table states."""
    return rng.standard_normal(len(seen.time)) * (0.2 + seen.follows ** float(rng.uniform(0.5, 3.0)))


def _calming(rng: Rng, seen: Recorded) -> NDArray[np.float64]:
    noise = np.convolve(rng.standard_normal(len(seen.time) + 4), [1.0, 0.8, 0.5, 0.2], "valid")[: len(seen.time)]
    return noise * (0.3 + np.exp(-np.linspace(0.0, rng.uniform(1.0, 5.0), len(noise))))


def _bursts(rng: Rng, seen: Recorded) -> NDArray[np.float64]:
    loud = np.ones(len(seen.time))
    for start in rng.integers(0, len(loud), 4):
        loud[start : start + int(rng.integers(5, 40))] = 6.0
    return rng.standard_normal(len(loud)) * loud


def _outliers(rng: Rng, seen: Recorded) -> NDArray[np.float64]:
    noise = rng.standard_normal(len(seen.time))
    wrong = rng.random(len(noise)) < 1.0 / 60.0
    return np.where(wrong, rng.normal(0.0, 20.0, len(noise)), noise)


def _irregular(rng: Rng, seen: Recorded) -> NDArray[np.float64]:
    steps = np.diff(seen.time, prepend=seen.time[0])
    longest = float(rng.uniform(2.0, 40.0)) * float(np.median(steps[1:]))
    noise, last = np.empty(len(steps)), rng.standard_normal()
    for k, step in enumerate(steps):
        keep = float(np.exp(-step / longest))
        last = noise[k] = keep * last + np.sqrt(1.0 - keep**2) * rng.standard_normal()
    return noise + 0.3 * rng.standard_normal(len(noise))


def _held(rng: Rng, seen: Recorded) -> NDArray[np.float64]:
    """A sensor that answers more slowly than it is asked: each value stands for some rows."""
    noise, k = np.empty(len(seen.time)), 0
    while k < len(noise):
        for_rows = int(rng.integers(2, 9))
        noise[k : k + for_rows] = rng.standard_normal()
        k += for_rows
    return noise


def _hum(rng: Rng, seen: Recorded) -> NDArray[np.float64]:
    phase = np.cumsum(2.0 * np.pi * rng.uniform(0.02, 0.45) + 0.15 * rng.standard_normal(len(seen.time)))
    return np.sin(phase + rng.uniform(0.0, 6.0)) + 0.5 * rng.standard_normal(len(phase))


def _skewed(rng: Rng, seen: Recorded) -> NDArray[np.float64]:
    noise = rng.exponential(1.0, len(seen.time) + 1)
    return noise[1:] + 0.5 * noise[:-1]


def _two_resonances(rng: Rng, seen: Recorded) -> NDArray[np.float64]:
    sos = []
    for _ in range(2):
        radius, turn = float(rng.uniform(0.9, 0.985)), float(rng.uniform(0.1, 2.8))
        sos.append([1.0, 0.0, 0.0, 1.0, -2.0 * radius * np.cos(turn), radius**2])
    both = [sosfilt([one], rng.standard_normal(len(seen.time) + 800))[800:] for one in sos]
    return both[0] / np.std(both[0]) + 0.6 * both[1] / np.std(both[1])


def _wandering(rng: Rng, seen: Recorded) -> NDArray[np.float64]:
    slow = sosfilt([[1.0, 0.0, 0.0, 1.0, -1.97, 0.9704]], rng.standard_normal(len(seen.time) + 900))[900:]
    return slow / np.std(slow) + float(rng.uniform(0.1, 0.6)) * rng.standard_normal(len(slow))


def _median(rng: Rng, seen: Recorded) -> NDArray[np.float64]:
    return medfilt(rng.standard_t(2.5, len(seen.time)), int(rng.choice([3, 5, 9])))


def _differenced(rng: Rng, seen: Recorded) -> NDArray[np.float64]:
    noise = rng.standard_normal(len(seen.time) + 1)
    return noise[1:] - float(rng.uniform(0.6, 1.0)) * noise[:-1]


def _tails_that_last(rng: Rng, seen: Recorded) -> NDArray[np.float64]:
    keep = float(rng.uniform(0.5, 0.95))
    return np.asarray(sosfilt([[1.0, 0.0, 0.0, 1.0, -keep, 0.0]], rng.standard_t(3.0, len(seen.time) + 300))[300:])


LOOKED_AT: dict[str, Noise] = {
    "butter": _butter,
    "smoothed": _smoothed,
    "pink": _pink,
    "coarse": _coarse,
    "by-load": _by_load,
    "calming": _calming,
    "bursts": _bursts,
    "outliers": _outliers,
    "irregular": _irregular,
    "held": _held,
}
KEPT_APART: dict[str, Noise] = {
    "hum": _hum,
    "skewed": _skewed,
    "two-resonances": _two_resonances,
    "wandering": _wandering,
    "median": _median,
    "differenced": _differenced,
    "tails-that-last": _tails_that_last,
}
NOISES = LOOKED_AT | KEPT_APART

MISSING = 0.3
"""Share of tables from which rows are missing, one in ten of them."""


def write(kind: str, seed: int, folder: Path, runs: int = 0) -> tuple[list[Path], TableOptions]:
    """Write one table, of so many files or of one, three or six, and say how it is to be read."""
    rng = np.random.default_rng([4711, seed, sum(map(ord, kind))])
    files = int(rng.choice([1, 1, 3, 6]))
    files = runs or files
    make = OBJECTS[int(rng.integers(len(OBJECTS)))]
    total = int(rng.integers(300, 900))
    paths, measured = [], ""
    for number in range(files):
        rows = total // files
        steps = rng.exponential(1.0, rows) + 0.2 if kind == "irregular" else np.ones(rows)
        at = (np.cumsum(steps) - steps[0]) / np.sum(steps)
        seen = make(np.random.default_rng([seed, number]) if make is not _poses else rng, rows, at)
        noise = NOISES[kind](rng, seen)
        size = 10.0 ** float(np.random.default_rng(seed).uniform(-3.0, -1.0)) * float(np.std(seen.simulated))
        measured = f"measured_{seen.unit}"
        columns = {
            seen.clock: seen.time,
            measured: seen.simulated + size * (noise - 0.2) / np.std(noise),
            f"model_{seen.unit}": seen.simulated,
            **seen.columns,
        }
        kept = rng.random(rows) > (0.1 if rng.random() < MISSING else 0.0)
        path = folder / f"{kind}-{seed}-{number + 1}.csv"
        table = np.column_stack(list(columns.values()))[kept]
        np.savetxt(path, table, fmt="%.7g", delimiter=",", header=",".join(columns), comments="")
        paths.append(path)
    return paths, TableOptions(measured, measured.replace("measured", "model"))


def answer(kind: str, seed: int, runs: int = 0, *, hold_out: bool = True) -> dict[str, object]:
    """What the program says of one table: names by verdict; parts are held out only where that decides."""
    began = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        table = load_tables(*write(kind, seed, Path(folder), runs)).table
    found = find_mismatch(table, hold_out=False)
    if hold_out and found.identified:
        found = find_mismatch(table)
    said = {
        str(v): "; ".join(one.name for one in found.findings if one.verdict is v)
        for v in (Verdict.IDENTIFIED, Verdict.HAPPENED, Verdict.DOES_NOT_PREDICT)
    }
    return {
        "kind": kind,
        "seed": seed,
        "rows": len(table),
        "blocks": len(table.blocks),
        "object": "/".join(v.name for v in table.variables[:2]),
        **said,
        "beginning": found.settled.beginning.name,
        "order": found.settled.noise.order,
        "seconds": f"{time.process_time() - began:.1f}",
    }


def set_constant(text: str) -> None:
    """Give a constant of the program another value, written as `inference.coloured.SHORTEST_OF_ALL=8`."""
    name, value = text.split("=")
    module, constant = name.rsplit(".", 1)
    declared = import_module(f"dbbstation.{module}")
    setattr(declared, constant, type(getattr(declared, constant))(value))


def main() -> None:
    """Run what the file has not, and print how many tables have a false name."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--count", type=int, default=6)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--kinds", default=",".join(NOISES))
    options.add_argument("--out", type=Path, required=True)
    options.add_argument("--workers", type=int, default=os.cpu_count())
    options.add_argument("--files", type=int, default=0)
    options.add_argument("--set", action="append", default=[], metavar="MODULE.NAME=VALUE")
    chosen = options.parse_args()
    for text in chosen.set:
        set_constant(text)
    rows: list[dict[str, str]] = []
    if chosen.out.exists():
        with chosen.out.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
    known = {(row["kind"], int(row["seed"])) for row in rows}
    wanted = [(kind, chosen.seed * 1000 + k) for k in range(chosen.count) for kind in chosen.kinds.split(",")]
    # Forked, so that the values that were set hold in the workers.
    with ProcessPoolExecutor(chosen.workers, get_context("fork")) as pool:
        for done in as_completed([pool.submit(answer, *one, chosen.files) for one in wanted if one not in known]):
            rows.append({name: str(value) for name, value in done.result().items()})
            with chosen.out.open("w", encoding="utf-8", newline="") as file:
                writer = csv.DictWriter(file, list(rows[0]))
                writer.writeheader()
                writer.writerows(rows)
    for kind in dict.fromkeys(row["kind"] for row in rows):
        own = [row for row in rows if row["kind"] == kind]
        counts = {v: sum(bool(row[v]) for row in own) for v in ("identified", "happened", "does-not-predict")}
        slowest = max(float(row["seconds"]) for row in own)
        said = ", ".join(f"{v} in {count}" for v, count in counts.items())
        print(f"{kind:16} {len(own):3} tables: {said}; slowest {slowest:.0f} s")  # noqa: T201


if __name__ == "__main__":
    sys.exit(main())
