"""Circles of the two papers as motions, and random machines to try error sources on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dbbstation.machine.geometry import Compliance, JointAxes, Machine, Masses, Rotation, StrutMasses
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Plate
from dbbstation.sources.causes.base_joints import BaseJoints
from dbbstation.sources.causes.strut_reference_length import StrutReferenceLength
from dbbstation.sources.contract import Motion, Setup
from dbbstation.trace.columns import currents, temperatures

# [GRAV Table 4]: centre X, Y [mm], tilt A, B [deg]; all at Z = -1008 mm with a radius of 144 mm.
CONDITIONS = {
    "A": (0, 100, -23, 0),
    "B": (100, 0, 0, 23),
    "C": (-70, -70, 17, -17),
    "D": (0, 100, -25, 0),
    "E": (0, 100, -20, 0),
    "F": (0, 100, -10, 0),
    "G": (0, 100, 0, 0),
    "H": (0, 100, 10, 0),
    "I": (0, 100, 23, 0),
}

# [CAL Table II]: bore, level, tilt A, B [deg]; bores numbered round the plate from +Y, level 1 the lowest.
JIG_TESTS = {
    "a": (9, 1, 0, 0),
    "b": (4, 1, 10, -10),
    "c": (6, 1, 10, 10),
    "d": (8, 1, -10, 10),
    "e": (2, 1, -10, -10),
    "f": (9, 2, 0, 0),
    "g": (3, 2, 0, -15),
    "h": (5, 2, 15, 0),
    "i": (7, 2, 0, 15),
    "j": (1, 2, -15, 0),
    "k": (9, 3, 0, 0),
    "l": (4, 3, 10, -10),
    "m": (6, 3, 10, 10),
    "n": (8, 3, -10, 10),
    "o": (2, 3, -10, -10),
}
BORES_MM = {
    1: (0, 100),
    2: (-100, 100),
    3: (-100, 0),
    4: (-100, -100),
    5: (0, -100),
    6: (100, -100),
    7: (100, 0),
    8: (100, 100),
    9: (0, 0),
}
PLATE = Plate((0.0, 0.0, -1150.0), 11.5)
LEVELS_MM = {1: -1150.0, 2: -1008.0, 3: -870.0}
DEG_PER_S = np.degrees(1000.0 / 60.0 / 150.0)


def circle(centre_mm, tilt_deg, theta_deg, radius_mm=150.0, **given) -> Motion:
    theta = np.radians(theta_deg)
    ball = np.array(centre_mm, dtype=float)
    poses = np.zeros((len(theta), 6))
    poses[:, :3] = ball + radius_mm * np.column_stack([np.cos(theta), np.sin(theta), np.zeros(len(theta))])
    poses[:, 3:5] = tilt_deg
    setup = Setup("session", "mounting", "ball", "bar", ball, 1e-3, 1e-3, 5e-4, plate=PLATE, run="run")
    return Motion(poses, setup=setup, **given)


def run(centre_mm, tilt_deg, *, clockwise=False, started_s=0.0, step_deg=2.0, lead_in_deg=45.0) -> Motion:
    phi = np.arange(-lead_in_deg, 360.0, step_deg)
    before = int(np.count_nonzero(phi < 0))
    return circle(
        centre_mm,
        tilt_deg,
        -phi if clockwise else phi,
        is_path=True,
        kept=slice(before, None),
        time_s=started_s + phi / DEG_PER_S,
    )


def jig_runs(step_deg=2.0, pause_s=120.0) -> list[Motion]:
    """Thirty runs one after the other: the fifteen jig circles counter-clockwise and clockwise."""
    starts = iter(np.arange(30) * (360.0 / DEG_PER_S + pause_s))
    return [
        run(
            (*BORES_MM[bore], LEVELS_MM[level]),
            (a, b),
            clockwise=clockwise,
            started_s=next(starts),
            step_deg=step_deg,
        )
        for bore, level, a, b in JIG_TESTS.values()
        for clockwise in (False, True)
    ]


def random_machine(reference: Machine, rotation: Rotation, rng) -> Machine:
    """A machine with joints some centimetres off the reference, and with all masses and axes known."""
    hexapod = replace(reference.hexapod, rotation=rotation)
    return replace(
        reference,
        hexapod=hexapod.moved(rng.normal(0, 15, (6, 3)), rng.normal(0, 15, (6, 3))),
        masses=Masses(rng.uniform(200, 600), rng.uniform(300, 600)),
        compliance=Compliance(rng.uniform(5e-6, 2e-5), rng.uniform(0.3, 1.0)),
        strut_masses=StrutMasses(*rng.uniform([10, 5, 200, 5, 1300], [30, 25, 400, 15, 1700])),
        joint_axes=JointAxes(*rng.normal(0, [1, 1, 0.1], (2, 6, 3))),
    )


def random_run(rng, count=300) -> Motion:
    """A path that wanders without system, tilting as it goes, with a rising time."""
    s = np.linspace(0, 1, count)[:, None]
    waves = sum(rng.normal(0, 1 / k, 6) * np.sin(2 * np.pi * k * s + rng.uniform(0, 2 * np.pi, 6)) for k in range(1, 4))
    poses = np.array([0, 0, -1030, 0, 0, 0]) + waves * np.array([50, 50, 30, 4, 4, 2])
    setup = Setup(
        "session", "mounting", "ball", "bar", np.array([10.0, 20.0, -1150.0]), 1e-3, 1e-3, 5e-4, plate=PLATE, run="run"
    )
    time_s = np.sort(rng.uniform(0, 5000, count))
    reading = 150.0 + 0.05 * np.sin(6 * np.pi * s[:, 0])
    return Motion(
        poses,
        is_path=True,
        kept=slice(20, None),
        time_s=time_s,
        setup=setup,
        reading_mm=reading,
        logged={
            **temperatures(dict.fromkeys(("bar", "machine"), 20.0 + time_s / 2000.0)),
            **currents(np.zeros((count, 6))),
        },
    )


def concealed(machine: Machine, runs: list[Motion], derivative) -> tuple[NDArray, NDArray, int]:
    """What the 24 kinematic parameters take of bar readings, by least squares at the nominal machine.

    Args:
        derivative: effect of each of p signatures on a motion.

    Returns:
        Signatures (n, p) [mm], what remains of them (n, p) [mm], number of parameters that the runs can see.
    """
    columns, signatures = [], []
    for motion in runs:
        reading = MachineModel(machine).bar(motion)
        kinematic = (StrutReferenceLength(), BaseJoints())
        by = [reading.by_parameters(source.derivative(motion, machine, np.zeros(24))) for source in kinematic]
        columns.append(np.hstack(by))
        signatures.append(reading.by_parameters(derivative(motion)))
    left, singular, _ = np.linalg.svd(np.vstack(columns), full_matrices=False)
    seen = left[:, singular > 1e-9 * singular[0]]
    signature = np.vstack(signatures)
    return signature, signature - seen @ (seen.T @ signature), seen.shape[1]


def concealed_share(machine: Machine, runs: list[Motion], derivative) -> NDArray:
    """Share of each signature's sum of squares that the kinematic parameters take, shape (p,) [1]."""
    signature, remains, _ = concealed(machine, runs, derivative)
    return 1 - (remains**2).sum(axis=0) / (signature**2).sum(axis=0)
