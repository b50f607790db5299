"""A small blind study of drives: `python -m tests.diagnosis.drive.blind --count 20 --seed 31`.

Every drive has one to three causes, a noise, an encoder and strokes that are drawn. Of what is said with a probability of 0.95 or
more it is counted how much is there, and of mass, viscous and Coulomb friction how many lie within two standard uncertainties.
"""

from __future__ import annotations

import argparse
import sys
from math import cos, exp, pi

import numpy as np

from dbbstation.diagnosis.drive.identify import identify
from dbbstation.diagnosis.drive.sources import known_drive_sources
from dbbstation.results.drive import drive_result
from dbbstation.trace.drive import DriveRecording
from tests.diagnosis.drive.plant import Truth, record, to_and_fro

CAUSES = (
    "friction-asymmetry",
    "stiffness",
    "cogging",
    "stribeck-friction",
    "position-friction",
    "presliding",
    "friction-drift",
    "constant-load",
    "transient-force",
)
DRY = ("stribeck-friction", "position-friction", "presliding", "friction-drift")
"""Those that there are beside Coulomb friction only."""

OFFSETS = {"constant-load", "friction-asymmetry"}
"""A spring whose rest is not the mean position is a constant force too: right beside stiffness."""


def drawn(rng):
    """Return a drive with Coulomb friction, mostly, and one or two further causes, and the names of what it has."""
    coulomb = rng.uniform(5, 50) * (rng.random() < 0.8)
    viscous = rng.uniform(50, 600)
    has = dict.fromkeys(CAUSES, 0.0) | dict.fromkeys(rng.choice(CAUSES, rng.integers(1, 3), replace=False), 1.0)
    if not coulomb:
        has |= dict.fromkeys(DRY, 0.0)
    asymmetry = has["friction-asymmetry"] * rng.choice([-1, 1]) * rng.uniform(0.1, 0.3) * viscous
    load = has["constant-load"] * rng.uniform(2, 4) * max(coulomb, 10.0)
    stiffness = has["stiffness"] * rng.uniform(20, 200)
    wave, period, phase = has["cogging"] * rng.uniform(1, 5), rng.uniform(0.003, 0.012), rng.uniform(0, 6)
    excess, stribeck = has["stribeck-friction"] * rng.uniform(0.2, 0.6) * coulomb, rng.uniform(0.004, 0.015)
    slope = has["position-friction"] * rng.uniform(0.1, 0.4) * coulomb
    late, length = has["presliding"] * rng.uniform(0.5, 1) * coulomb, rng.uniform(2e-4, 2e-3)
    change, tau = has["friction-drift"] * -rng.uniform(0.1, 0.4) * coulomb, rng.uniform(3, 20)
    pulse, start, lasts = has["transient-force"] * rng.uniform(3, 12), rng.uniform(3, 18), rng.uniform(0.2, 3)
    truth = Truth(
        mass_kg=rng.uniform(30, 200),
        viscous=viscous,
        coulomb=coulomb,
        viscous_asymmetry=asymmetry,
        load=lambda t, x, _v: (
            load
            + stiffness * (x - 0.1)
            + wave * cos(2 * pi * x / period + phase)
            + pulse * (start <= t < start + lasts)
        ),
        sliding=lambda t, x, v, d: (
            excess * exp(-abs(v) / stribeck)
            + slope * (x - 0.1) / 0.1
            - 2 * late * exp(-d / length)
            + change * (1 - exp(-t / tau))
        ),
    )
    return truth, {name for name, there in has.items() if there} | ({"coulomb-friction"} if coulomb else set())


def judged(rng, seed):
    """Names of a drawn drive, of what was said of it with 0.95 or more, what is wrong of that, and which values are covered."""
    truth, has = drawn(rng)
    command = to_and_fro(tuple(rng.uniform(0.02, 0.15, rng.integers(3, 6))), rng.uniform(0.1, 0.3), rng.uniform(0.5, 3))
    noise, resolution = rng.uniform(0.2, 2.0), 10 ** rng.uniform(-7.3, -6.0)
    columns = record(truth, command, seed, force_noise=noise, resolution=resolution)
    summary = drive_result(
        identify([DriveRecording("drawn", *columns)], list(known_drive_sources().values()))
    ).to_dict()
    said = {s["name"] for s in summary["sources"] if s["verdict"] in {"identified", "happened"}}
    wrong = said - has - (OFFSETS if "stiffness" in has else set())
    values = [
        (summary["parameters"]["mass_kg"], truth.mass_kg),
        (summary["parameters"]["viscous_n_s_m"], truth.viscous),
    ]
    values = [(number, true) for number, true in values if number["identifiable"]]
    for source in summary["sources"]:
        if source["name"] == "coulomb-friction" and source["name"] in said & has and not has & set(DRY):
            values.append((source["parameters"]["coulomb_n"], truth.coulomb))
    inside = [abs(number["value"] - true) < 2.0 * number["uncertainty"] for number, true in values]
    return has, said, wrong, inside


def study(count, seed):
    """Figures of so many drawn drives, and a line per drive that got a wrong name or missed one."""
    rng = np.random.default_rng(seed)
    there = found = said = wrong = 0
    inside, lines = [], []
    for number in range(count):
        has, named, extra, covered = judged(rng, number)
        there, found = there + len(has), found + len(has & named)
        said, wrong = said + len(named), wrong + len(extra)
        inside += covered
        if extra or has - named:
            lines.append(f"drive {number}: missed {sorted(has - named)}, wrong {sorted(extra)}")
    return {
        "drives": count,
        "causes": there,
        "named": found,
        "said": said,
        "wrong": wrong,
        "values": len(inside),
        "within_2u": int(np.sum(inside)),
        "lines": lines,
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=31)
    options = parser.parse_args()
    figures = study(options.count, options.seed)
    lines = [f"{key} {value}" for key, value in figures.items() if key != "lines"]
    sys.stdout.write("\n".join([*lines, *figures["lines"]]) + "\n")
