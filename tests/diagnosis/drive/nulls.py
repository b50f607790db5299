"""Drives of mass, viscous and Coulomb friction under six kinds of noise: whatever else is named is false.

    python -m tests.diagnosis.drive.nulls --count 12 --seed 1 [--kinds white,jitter]

A drive has a mass, frictions, strokes and a noise that are drawn. It is counted how many drives get a false name with 0.95 or more,
how many such names there are, and of masses, viscous and Coulomb frictions how many lie within two standard uncertainties.
"""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import butter, sosfilt

from dbbstation.diagnosis.drive.identify import identify
from dbbstation.diagnosis.drive.sources import known_drive_sources
from dbbstation.results.drive import drive_result
from dbbstation.trace.drive import DriveRecording
from tests.diagnosis.drive.plant import RATE_HZ, Truth, record, to_and_fro

if TYPE_CHECKING:
    from numpy.typing import NDArray

KINDS = ("white", "low-passed", "resonant", "jitter", "quantised", "one-way")
SECONDS = 16.0


def forces(kind: str, rng: np.random.Generator, rows: int) -> NDArray[np.float64]:
    """Noise of the force with a standard deviation of one, shape (rows,)."""
    white = rng.standard_normal(rows + 8 * RATE_HZ)
    if kind == "low-passed":
        found = sosfilt(butter(2, rng.uniform(1.0, 6.0), fs=RATE_HZ, output="sos"), white)
    elif kind == "resonant":
        frequency, damping = rng.uniform(3.0, 15.0), rng.uniform(0.02, 0.08)
        angle, radius = 2.0 * np.pi * frequency / RATE_HZ, np.exp(-2.0 * np.pi * frequency * damping / RATE_HZ)
        found = sosfilt([[1.0, 0.0, 0.0, 1.0, -2.0 * radius * np.cos(angle), radius**2]], white)
    else:
        found = white
    found = found[-rows:]
    return np.asarray(found / found.std())


def one_way(rng: np.random.Generator) -> NDArray[np.float64]:
    """Set position of a drive that starts and stops at a dozen speeds, some of them slow, and never turns back [m]."""
    dt, out, x = 1.0 / RATE_HZ, [np.zeros(0)], 0.0
    while sum(len(part) for part in out) * dt < SECONDS:
        speed = float(rng.choice([0.002, 0.005, 0.02, 0.06, 0.12]))
        ramp = max(int(speed / 1.0 / dt), 20)
        profile = np.concatenate(
            [np.linspace(0.0, speed, ramp), np.full(int(0.8 / dt), speed), np.linspace(speed, 0.0, ramp)]
        )
        out.append(x + np.cumsum(profile * dt))
        x = float(out[-1][-1])
    return np.concatenate(out)[: int(SECONDS / dt)]


def drawn(kind: str, seed: int) -> tuple[Truth, DriveRecording]:
    rng = np.random.default_rng([KINDS.index(kind), seed])
    truth = Truth(mass_kg=rng.uniform(30, 200), viscous=rng.uniform(100, 600), coulomb=rng.uniform(8, 40))
    if kind == "one-way":
        command = one_way(rng)
    else:
        speeds = tuple(rng.uniform(0.02, 0.15, rng.integers(3, 6)))
        command = to_and_fro(speeds, rng.uniform(0.1, 0.25), rng.uniform(0.7, 2.5), SECONDS)  # type: ignore[no-untyped-call]
    t, position_mm, force = record(truth, command, seed, force_noise=0.0)  # type: ignore[no-untyped-call]
    force = force + rng.uniform(0.01, 0.05) * force.std() * forces(kind, rng, len(t))
    if kind in {"jitter", "one-way"}:
        off = t + rng.uniform(0.1, 0.4) / RATE_HZ * rng.standard_normal(len(t))
        position_mm, force = np.interp(off, t, position_mm), np.interp(off, t, force)
    if kind in {"quantised", "one-way"}:
        step = rng.uniform(0.005, 0.02)
        position_mm = step * np.round(position_mm / step)
    return truth, DriveRecording(f"{kind} {seed}", t, position_mm, force)


def judged(kind: str, seed: int) -> tuple[set[str], list[bool]]:
    """False names that were said, and for each value that was, whether it lies within two standard uncertainties."""
    truth, recording = drawn(kind, seed)
    summary = drive_result(identify([recording], list(known_drive_sources().values()))).to_dict()
    found = {s["name"]: s for s in summary["sources"] if s["verdict"] in {"identified", "happened"}}
    coulomb = found.pop("coulomb-friction", None)
    parameters = summary["parameters"]
    numbers = [(parameters["mass_kg"], truth.mass_kg), (parameters["viscous_n_s_m"], truth.viscous)]
    numbers = [(number, true) for number, true in numbers if number["identifiable"]]
    if coulomb is not None:
        numbers.append((coulomb["parameters"]["coulomb_n"], truth.coulomb))
    return set(found), [abs(number["value"] - true) < 2.0 * number["uncertainty"] for number, true in numbers]


def study(kind: str, count: int, seed: int) -> dict[str, object]:
    outcomes = [judged(kind, 1000 * seed + k) for k in range(count)]
    return {
        "kind": kind,
        "drives": count,
        "with_false_names": sum(bool(names) for names, _ in outcomes),
        "false_names": sum(len(names) for names, _ in outcomes),
        "values": sum(len(inside) for _, inside in outcomes),
        "within_2u": sum(sum(inside) for _, inside in outcomes),
        "names": " ".join(sorted(name for names, _ in outcomes for name in names)),
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", default=",".join(KINDS))
    options = parser.parse_args()
    for each in options.kinds.split(","):
        figures = study(each, options.count, options.seed)
        sys.stdout.write(", ".join(f"{key} {value}" for key, value in figures.items()) + "\n")
        sys.stdout.flush()
