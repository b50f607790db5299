"""Figures of circles and plane before and after [CAL Table III, Fig 7]."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from dbbstation.calibration.fit.calibrate import of_residuals
from dbbstation.computing.arrays import hypot_of, range_of
from dbbstation.computing.threads import with_one_thread
from dbbstation.facts import OfRun
from dbbstation.facts.serialise import Absent
from dbbstation.model.identified import range_uncertainty_mm
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.tolerance import OF_A_MODEL, USUAL_UPR, CircleFigure, worst
from dbbstation.sources.contract import Motion
from dbbstation.trace.analysis import CircleFigures, figures

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.model.observation import Observation
    from dbbstation.plan.plan import Direction
    from dbbstation.plan.tolerance import Tolerance

PLANE_HALF_WIDTH_MM = 190.0
"""Half the square of 380 mm over which the paper states flatness and parallelism."""

STRAIGHT_POINTS = 39
"""Points along X for parallelism: every 10 mm."""

_RING = PLANE_HALF_WIDTH_MM * np.array([(-1, -1), (0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0)])
"""X and Y of the points for flatness [mm]."""

_ALONG = np.column_stack(
    [np.linspace(-PLANE_HALF_WIDTH_MM, PLANE_HALF_WIDTH_MM, STRAIGHT_POINTS), np.zeros(STRAIGHT_POINTS)]
)
"""X and Y of the move along X whose lateral deviation is parallelism [mm]."""


@dataclass(frozen=True)
class CircleDeviations:
    """Figures of one circle [CAL Table III]: centre deviation (also relative to the first test's centre), mean radial error, circularity."""

    centre_deviation_um: float
    mean_radial_error_um: float
    circularity_um: float
    centre_deviation_from_first_um: Annotated[float | None, Absent] = None


@dataclass(frozen=True)
class LowPassedCircularity:
    """Circular deviation G, low-passed at 30 undulations per revolution [µm].

    Attributes:
        before: of the nominal residual; for a plain circle as measured.
    """

    measured: float
    predicted: float
    before: float
    after: float


@dataclass(frozen=True)
class EvaluatedRun(OfRun):
    """One run under the nominal machine (before) and the model (after)."""

    measured: CircleDeviations
    before: CircleDeviations
    after: CircleDeviations
    circularity_30_upr_um: Annotated[LowPassedCircularity | None, Absent] = None


@dataclass(frozen=True)
class Evaluation:
    """Figures of recordings under the nominal machine and under a model."""

    runs: tuple[EvaluatedRun, ...]
    residual_rms_um: float
    nominal_rms_um: float


@with_one_thread
def evaluate(model: MachineModel, observations: Sequence[Observation]) -> Evaluation:
    """Compare recordings with the nominal machine and with a model.

    Raises:
        TraceError: a run that is no circle.
        ModelError: a source needs missing data.
    """
    before, nominal_rms_um = _under(MachineModel(model.machine), observations)
    after, left_rms_um = _under(model.of_the_machine(), observations)
    begun: dict[tuple[str, Direction], int] = {}
    first = [begun.setdefault((o.setup.session, o.raw.circle.direction), k) for k, o in enumerate(observations)]
    runs = tuple(
        EvaluatedRun(
            test=o.test,
            direction=str(o.raw.circle.direction),
            repeat=o.repeat,
            measured=_deviations(figures(o.raw)),
            before=_deviations(before[k], before[first[k]]),
            after=_deviations(after[k], after[first[k]]),
        )
        for k, o in enumerate(observations)
    )
    return Evaluation(runs, left_rms_um, nominal_rms_um)


def _deviations(of: CircleFigures, first: CircleFigures | None = None) -> CircleDeviations:
    apart = None if first is None else apart_um(of, first)
    return CircleDeviations(of.centre_deviation_um, of.mean_radial_error_um, of.circularity_um, apart)


def _under(model: MachineModel, observations: Sequence[Observation]) -> tuple[list[CircleFigures], float]:
    def of_run(observation: Observation, residual_mm: Floats) -> tuple[CircleFigures, float, int]:
        found = figures(observation.raw, observation.raw.circle.bar_mm + residual_mm)
        return found, float(residual_mm @ residual_mm), len(residual_mm)

    # Per run, because residuals need one number per sample.
    found, squares, counts = zip(*of_residuals(model, observations, of_run), strict=True)
    return list(found), 1e3 * sqrt(sum(squares) / sum(counts))


def rms_um(residual_mm: Sequence[Floats]) -> float:
    """Return the root mean square over all runs [µm]."""
    return 1e3 * sqrt(sum(float(one @ one) for one in residual_mm) / sum(map(len, residual_mm)))


@dataclass(frozen=True)
class PlaneFigures:
    """Accuracy of uncompensated motion over a plane [CAL Fig 7].

    Attributes:
        flatness_um: height range over eight points of the square.
        parallelism_um: range of lateral deviation of a move along X.
    """

    flatness_um: float
    parallelism_um: float


@with_one_thread
def plane_figures(model: MachineModel, height_mm: float, corrected: MachineModel | None = None) -> PlaneFigures:
    """Return flatness over eight points of X, Y = ±190 mm, and parallelism of a move along X.

    Only pose-dependent sources count.

    Args:
        corrected: calibrated model that the control corrects; the figures then describe its residual error.

    Raises:
        KinematicsError: the plane is outside the workspace.
    """
    heights = _error_mm(model, _RING, height_mm, corrected)[:, 2]
    sideways = _error_mm(model, _ALONG, height_mm, corrected)[:, 1]
    return PlaneFigures(1e3 * range_of(heights), 1e3 * range_of(sideways))


@with_one_thread
def plane_uncertainty_um(identified: IdentifiedModel, height_mm: float) -> tuple[float | None, float | None]:
    """Return standard uncertainties of flatness and parallelism [µm], None if unknown."""
    identified = replace(identified, model=identified.model.anywhere())
    found = [
        range_uncertainty_mm(identified, Motion(_level(points, height_mm)), axis)
        for points, axis in ((_RING, 2), (_ALONG, 1))
    ]
    flatness_um, parallelism_um = (None if u_mm is None else 1e3 * u_mm for u_mm in found)
    return flatness_um, parallelism_um


def _level(xy_mm: Floats, height_mm: float) -> Floats:
    poses = np.zeros((len(xy_mm), 6))
    poses[:, :2], poses[:, 2] = xy_mm, height_mm
    return poses


def _error_mm(model: MachineModel, xy_mm: Floats, height_mm: float, corrected: MachineModel | None) -> Floats:
    poses = _level(xy_mm, height_mm)
    motion = Motion(poses)
    actual = model.anywhere().actual_poses(motion)
    believed = poses if corrected is None else corrected.anywhere().actual_poses(motion)
    return actual[:, :3] - believed[:, :3]


def apart_um(a: CircleFigures, b: CircleFigures) -> float:
    """Return the distance of two centres [µm]."""
    return 1e3 * hypot_of(a.centre_mm[0] - b.centre_mm[0], a.centre_mm[1] - b.centre_mm[1])


@dataclass(frozen=True)
class WorstRun:
    """The run with the largest toleranced figure."""

    run: str
    worst_um: float
    within: bool


@dataclass(frozen=True)
class EvaluatedTolerance:
    """A tolerance and its worst runs.

    Attributes:
        before: worst run under the nominal machine; None without applicable run.
        after: the same under the model.
    """

    quantity: str
    largest_um: float
    tests: tuple[str, ...]
    directions: tuple[str, ...]
    before: WorstRun | None
    after: WorstRun | None


def stated(tolerance: Tolerance) -> Mapping[str, Any]:
    """Return what a tolerance states, by name."""
    directions = tuple(direction.value for direction in tolerance.directions)
    found = {"quantity": tolerance.figure.value, "tests": tuple(tolerance.tests), "directions": directions}
    return {**found, "largest_um": tolerance.largest_um}


def evaluated_tolerances(
    tolerances: Iterable[Tolerance], runs: Sequence[EvaluatedRun]
) -> tuple[EvaluatedTolerance, ...]:
    """Compare tolerances with runs under the nominal machine and under the model."""
    return tuple(
        EvaluatedTolerance(
            **stated(tolerance),
            before=_worst(tolerance, [(run, run.before, _low_passed(run)[0]) for run in runs]),
            after=_worst(tolerance, [(run, run.after, _low_passed(run)[1]) for run in runs]),
        )
        for tolerance in tolerances
        if tolerance.figure in OF_A_MODEL and tolerance.upr == USUAL_UPR
    )


def _low_passed(run: EvaluatedRun) -> tuple[float, float]:
    if run.circularity_30_upr_um is None:
        raise ValueError("these runs have no low-passed readings, which the tolerances need")
    return run.circularity_30_upr_um.before, run.circularity_30_upr_um.after


def _worst(tolerance: Tolerance, runs: Sequence[tuple[EvaluatedRun, CircleDeviations, float]]) -> WorstRun | None:
    named = [
        (
            *run.key,
            {
                CircleFigure.CIRCULAR_DEVIATION: circular_um,
                CircleFigure.CENTRE_DEVIATION: of.centre_deviation_um,
                CircleFigure.MEAN_RADIAL_ERROR: of.mean_radial_error_um,
            },
        )
        for run, of, circular_um in runs
    ]
    one = worst(tolerance, named)
    return None if one is None else WorstRun(one.run, one.size_um, one.within)
