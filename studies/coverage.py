"""Do 95 % intervals contain the truth? Random machines."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import ndtri

from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.calibration.reporting.figures import identified_model
from dbbstation.model.identified import position_uncertainty_mm
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted, Motion
from dbbstation.virtual.truth import random_kinematics
from studies.random_machines import over_machines
from studies.virtual_session import draw_session

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine
    from dbbstation.plan.plan import Plan

NOISE_MM = 0.0005
SAMPLES = 120
"""Per turn; more would change the noise only, which mountings outweigh."""

LEVEL = 0.95
WITHIN = float(ndtri(0.5 + LEVEL / 2.0))

PLACES = 40
"""Poses at which predicted positions are looked at, drawn anew for every machine."""

REACH_MM, REACH_DEG = 150.0, 10.0


@dataclass(frozen=True, eq=False)
class Coverage:
    """Errors in stated standard deviations.

    Attributes:
        parameters: shape (m, 24).
        positions: by machine, pose and axis, shape (m, 40, 3).
    """

    parameters: NDArray[np.float64]
    positions: NDArray[np.float64]
    sigma_um: NDArray[np.float64]
    names: tuple[str, ...]

    def numbers(self) -> dict[str, Any]:
        """Return shares inside the 95 % intervals."""
        inside = np.abs(self.parameters) < WITHIN
        per_parameter = {
            name: {"inside": float(share), "sigma_um": float(sigma)}
            for name, share, sigma in zip(self.names, inside.mean(axis=0), self.sigma_um, strict=True)
        }
        # Where a coordinate has no stated uncertainty there is nothing to hold against the truth.
        inside_there = (np.abs(self.positions) < WITHIN).sum(axis=(0, 1))
        stated = np.isfinite(self.positions).sum(axis=(0, 1))
        return {
            "machines": len(self.parameters),
            "parameters_pooled": float(inside.mean()),
            "parameters_least": float(inside.mean(axis=0).min()),
            "parameters_most": float(inside.mean(axis=0).max()),
            "chance_of_one_parameter": wilson(LEVEL, len(inside)),
            "positions_pooled": float(inside_there.sum() / max(int(stated.sum()), 1)),
            "positions_by_axis": {
                axis: float(inside_there[k] / stated[k]) for k, axis in enumerate("xyz") if stated[k]
            },
            "parameters": per_parameter,
        }


def coverage(
    machine: Machine, plan: Plan, seeds: Sequence[int], progress: Callable[[int], None], *, level: bool
) -> Coverage:
    """Draw machines, record, calibrate, and compare with the truth.

    Args:
        level: no raised bar: base joints are drawn without common height, which level bars miss.
    """
    done = []
    for one in over_machines(partial(_machine, machine, plan, level=level), seeds):
        done.append(one)
        progress(len(done))
    parameters, positions, sigma, names = zip(*done, strict=True)
    return Coverage(np.array(parameters), np.array(positions), np.median(sigma, axis=0), names[0])


def wilson(share: float, count: int, sigmas: float = 1.96) -> tuple[float, float]:
    """Return a share's interval in `count` trials [Wilson, J. Am. Stat. Assoc. 22 (1927) 209]."""
    centre = (share + sigmas**2 / (2 * count)) / (1 + sigmas**2 / count)
    half = sigmas * float(np.sqrt(share * (1 - share) / count + sigmas**2 / (4 * count**2))) / (1 + sigmas**2 / count)
    return max(centre - half, 0.0), min(centre + half, 1.0)  # of none and of all, rounding goes beyond


def _machine(
    machine: Machine, plan: Plan, seed: int, *, level: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], tuple[str, ...]]:
    """Return one machine's normalised parameter errors, (24,), position errors, (40, 3), standard deviations [µm], names."""
    rng = np.random.default_rng([seed, 7])
    kinematics = random_kinematics(machine, seed)
    if level:
        kinematics = tuple(_without_common_height(fitted) for fitted in kinematics)
    truth = MachineModel(machine, kinematics)
    calibration = calibrate(machine, draw_session(truth, plan, rng, NOISE_MM, SAMPLES))
    true = np.concatenate([fitted.values for fitted in kinematics])
    sigma = np.sqrt(np.diag(calibration.solution.covariance)[: len(true)])
    poses = rng.uniform(-1.0, 1.0, (PLACES, 6)) * [REACH_MM, REACH_MM, REACH_MM, REACH_DEG, REACH_DEG, 0.0]
    poses[:, 2] += sum(machine.travel.z_mm) / 2.0
    motion = Motion(poses)
    off = calibration.model.of_the_machine().actual_poses(motion)[:, :3] - truth.actual_poses(motion)[:, :3]
    uncertainty = position_uncertainty_mm(identified_model(calibration, {}, {}), motion)
    names = tuple(f"{source} {name}" for source, _, name in calibration.layout.names[: len(true)])
    return (calibration.x[: len(true)] - true) / sigma, off / uncertainty, 1e3 * sigma, names


def _without_common_height(fitted: Fitted) -> Fitted:
    if fitted.source.name != "base-joints":
        return fitted
    joints = fitted.values.reshape(-1, 3).copy()
    joints[:, 2] -= joints[:, 2].mean()
    return Fitted(fitted.source, joints.ravel(), fitted.shared)
