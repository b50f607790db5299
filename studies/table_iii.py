"""[CAL Table III] on random machines: three methods, verified on the jig.

Each machine is calibrated on conventional and jig plans, and verified with corrected commands. Gravity on elastic struts,
as in the paper, is not modelled.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.calibration.fit.methods import Method, as_known
from dbbstation.calibration.reporting.evaluation import apart_um, plane_figures
from dbbstation.errors import CalibrationError
from dbbstation.model.compensation import compensated
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources
from dbbstation.trace.analysis import figures
from dbbstation.virtual.truth import random_kinematics
from studies.random_machines import over_machines
from studies.virtual_session import draw_session

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.machine.geometry import Machine
    from dbbstation.model.observation import Observation
    from dbbstation.plan.plan import Plan

NOISE_MM = 0.0005
MICROMETER_MM = 0.001
SAMPLES = 120

COMPLIANCE_UM_KN = 9.68
"""Strut compliance with which the reference machine's circles bend as [GRAV Table 4] reports."""

PLANE_MM = -1008.0
"""Height of flatness and parallelism: the middle level of [CAL Table II]."""

POSITIONS = ("a", "d", "f", "h", "j", "k", "l", "n")
"""Where the paper verified [CAL Table III]."""

METHODS = ("default", Method.CONV_A, Method.CONV_B, "proposed")

PUBLISHED: dict[str, dict[str, float]] = {
    # [CAL IV]: means of Table III (a) without a, of the absolute values of (b), and of (c); Fig 7 within 380 x 380 mm.
    "centre_deviation_um": {"default": 103.3, "conv-a": 47.9, "conv-b": 43.2, "proposed": 8.6},
    "mean_radial_error_um": {"default": 59.6, "conv-a": 8.7, "conv-b": 2.2, "proposed": 3.0},
    "circularity_um": {"default": 28.9, "conv-a": 5.7, "conv-b": 11.8, "proposed": 7.5},
    "flatness_um": {"conv-a": 186.0, "conv-b": 194.0, "proposed": 20.0},
    "parallelism_um": {"conv-a": 78.0, "conv-b": 71.0, "proposed": 19.0},
}


@dataclass(frozen=True)
class Verified:
    """One calibration of one machine, verified.

    Attributes:
        centre_deviation_um: by position, relative to a.
        flatness_um: over eight points of X, Y = ±190 mm.
        parallelism_um: along X, ±190 mm.
    """

    centre_deviation_um: dict[str, float]
    mean_radial_error_um: dict[str, float]
    circularity_um: dict[str, float]
    flatness_um: float
    parallelism_um: float

    def figure(self, name: str) -> float:
        """Return the mean over positions, without a in centre deviations."""
        value = getattr(self, name)
        if not isinstance(value, dict):
            return float(value)
        counted = [abs(v) for place, v in value.items() if name != "centre_deviation_um" or place != POSITIONS[0]]
        return float(np.mean(counted))


@dataclass(frozen=True)
class TableIII:
    """All machines: by method, what was verified."""

    verified: dict[str, list[Verified]]

    def numbers(self) -> dict[str, Any]:
        """Return median and 90 % range by method, beside published values."""
        found: dict[str, Any] = {"machines": len(next(iter(self.verified.values())))}
        for figure, published in PUBLISHED.items():
            rows = {}
            for method, machines in self.verified.items():
                values = [one.figure(figure) for one in machines]
                low, median, high = np.percentile(values, [5.0, 50.0, 95.0]).tolist()
                rows[method] = {"median": median, "range": [low, high], "published": published.get(method)}
            found[figure] = rows
        found["gain_over_conv_a"] = {figure: self._gain(figure) for figure in PUBLISHED}
        found["positions"] = {
            figure: {
                method: {
                    place: float(np.median([getattr(one, figure)[place] for one in machines])) for place in POSITIONS
                }
                for method, machines in self.verified.items()
            }
            for figure in ("centre_deviation_um", "mean_radial_error_um", "circularity_um")
        }
        return found

    def _gain(self, figure: str) -> dict[str, Any]:
        """Return the proposed method's gain over Conv-A, by machine."""
        pairs = zip(self.verified[Method.CONV_A], self.verified["proposed"], strict=True)
        ratios = [a.figure(figure) / proposed.figure(figure) for a, proposed in pairs]
        low, median, high = np.percentile(ratios, [5.0, 50.0, 95.0]).tolist()
        published = PUBLISHED[figure]
        return {"median": median, "range": [low, high], "published": published["conv-a"] / published["proposed"]}


def table_iii(
    machine: Machine,
    conventional: Plan,
    jig: Plan,
    seeds: Sequence[int],
    progress: Callable[[int], None],
    *,
    gravity: bool,
) -> TableIII:
    """Calibrate and verify random machines.

    Args:
        conventional: balls under the spindle.
        gravity: elastic struts, unmodelled.
    """
    verified: dict[str, list[Verified]] = {str(method): [] for method in METHODS}
    work = partial(_machine, machine, conventional, jig, gravity=gravity)
    for done, one in enumerate(over_machines(work, seeds), start=1):
        for method, result in one.items():
            verified[method].append(result)
        progress(done)
    return TableIII(verified)


def _machine(machine: Machine, conventional: Plan, jig: Plan, seed: int, *, gravity: bool) -> dict[str, Verified]:
    rng = np.random.default_rng([seed, 8])
    weight = (Fitted(known_sources()["gravity"], np.array([COMPLIANCE_UM_KN])),) if gravity else ()
    truth = MachineModel(machine, (*random_kinematics(machine, seed), *weight))
    under_spindle = draw_session(truth, conventional, rng, NOISE_MM, SAMPLES, micrometer_mm=MICROMETER_MM)
    on_jig = draw_session(truth, jig, rng, NOISE_MM, SAMPLES)
    models = {
        "default": MachineModel(machine),
        str(Method.CONV_A): _calibrated(machine, Method.CONV_A, under_spindle),
        str(Method.CONV_B): _calibrated(machine, Method.CONV_B, under_spindle),
        "proposed": _calibrated(machine, Method.JIG, on_jig),
    }
    again = replace(jig, tests={name: jig.tests[name] for name in POSITIONS})
    return {method: _verify(truth, model, again, rng) for method, model in models.items()}


def _calibrated(machine: Machine, method: Method, runs: Sequence[Observation]) -> MachineModel:
    known = as_known(method, machine, runs)
    prescribe = None if method is Method.JIG else ()
    try:
        return calibrate(machine, known, prescribe=prescribe).model.of_the_machine()
    except CalibrationError as error:
        raise CalibrationError(f"{method}: {error.what}", remedy=error.remedy) from error


def _verify(truth: MachineModel, model: MachineModel, plan: Plan, rng: np.random.Generator) -> Verified:
    """Run the eight circles with corrected commands and new mountings."""
    runs = draw_session(truth, plan, rng, NOISE_MM, SAMPLES, command=partial(compensated, model))
    first = {run.test: figures(run.raw) for run in reversed(runs)}
    plane = plane_figures(truth, PLANE_MM, model)
    origin = first[POSITIONS[0]]
    return Verified(
        centre_deviation_um={place: apart_um(first[place], origin) for place in POSITIONS},
        mean_radial_error_um={place: first[place].mean_radial_error_um for place in POSITIONS},
        circularity_um={place: first[place].circularity_um for place in POSITIONS},
        flatness_um=plane.flatness_um,
        parallelism_um=plane.parallelism_um,
    )
