"""A machine model with the uncertainty and origin of its parameters, and the uncertainty of the tool's predicted place."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.computing.arrays import place_of_largest
from dbbstation.computing.counted import uncounted
from dbbstation.computing.threads import with_one_thread
from dbbstation.errors import KinematicsError
from dbbstation.facts.value import finite
from dbbstation.machine.kinematics import position_responses
from dbbstation.model.machine_model import by_parameters
from dbbstation.sources.contract import Motion

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import ArrayLike

    from dbbstation.computing.arrays import Floats
    from dbbstation.computing.counted import Counted
    from dbbstation.model.machine_model import MachineModel
    from dbbstation.sources.contract import Parameter


Row = tuple[str, str, str]
"""Source, sharing set and parameter of a row of the covariance."""


@dataclass(frozen=True, eq=False)
class IdentifiedModel:
    """The outcome of a calibration or diagnosis.

    Attributes:
        model: nominal machine with error sources of the machine and of the measurement.
        covariance_rows: (source, set, parameter) of every row.
        covariance: in products of units, shape (k, k), with formula errors; zero in directions held at nominal.
        directions_lost: descriptions of directions that the recordings do not determine.
        sessions: SHA-256 of its session files, by folder.
        null_space: undetermined combinations of rows, scaled to prior standard deviations, shape (h, k); None in old files.
        formula_variance: part of each row's variance due to its formula, equal in all sessions, shape (k,); None if zero.
    """

    model: MachineModel
    covariance_rows: tuple[Row, ...]
    covariance: Floats
    directions_lost: tuple[str, ...] = ()
    report: Mapping[str, Any] = field(default_factory=dict)
    sessions: Mapping[str, str] = field(default_factory=dict)
    null_space: Floats | None = None
    formula_variance: Floats | None = None

    @property
    def unseen(self) -> Floats | None:
        """Return the null space, shape (h, k); None if unknown."""
        if self.null_space is None and not self.directions_lost:
            return np.zeros((0, len(self.covariance_rows)))
        return self.null_space

    @property
    def uncertainties(self) -> dict[Row, float | None]:
        """Return each parameter's standard uncertainty; None if unknown.

        Prescribed parameters define the coordinates, so all parameters are known.
        """
        variance = np.maximum(np.diag(self.covariance), 0.0)
        along = np.where(variance > 0.0, 0.0, np.inf if self.directions_lost else 0.0)
        if self.report.get("parameters_prescribed"):
            along = np.zeros(len(variance))
        elif (unseen := self.unseen) is not None:
            along = np.sum(unseen**2, axis=0)
        u = known_u(variance, along)
        return {row: finite(value) for row, value in zip(self.covariance_rows, u.tolist(), strict=True)}

    @property
    def uncertainties_between_sessions(self) -> dict[Row, float]:
        """Return the standard uncertainty of each parameter for comparing two sessions.

        Formula errors and held values are common to both sessions and do not count.
        """
        variance = np.diag(self.covariance) - (0.0 if self.formula_variance is None else self.formula_variance)
        return dict(zip(self.covariance_rows, np.sqrt(np.maximum(variance, 0.0)).tolist(), strict=True))

    @property
    def why_unknown(self) -> str:
        """Return why a value's uncertainty is unknown."""
        if not self.directions_lost:
            return "the model states no uncertainty of its parameters"
        lost = "; ".join(self.directions_lost)
        if self.null_space is None:
            return f"an older program wrote the model, which does not say what this changes: {lost}"
        return f"the recordings do not determine: {lost}"


def values_of_machine(
    model: MachineModel, u: Mapping[Row, float | None]
) -> Iterator[tuple[str, Parameter, float, float | None]]:
    """Yield source, parameter, value and uncertainty of each of the machine's parameters."""
    for fitted in model.of_the_machine().sources:
        for parameter, value in zip(fitted.source.parameters(model.machine), fitted.values, strict=True):
            known = u.get((fitted.source.name, fitted.shared, parameter.name))
            yield fitted.source.name, parameter, float(value), known


def known_u(variance: Floats, along: Floats) -> Floats:
    """Return standard uncertainties; NaN if the prior mostly determines them."""
    return np.sqrt(np.where(along > variance, np.nan, variance + along))


@with_one_thread
def position_uncertainty_mm(identified: IdentifiedModel, motion: Motion, *, about_mean: bool = False) -> Floats:
    """Return standard uncertainties of predicted X, Y and Z, kept rows, shape (n, 3) [mm]; NaN if unknown.

    First-order propagation. It is unknown if an acting source has no uncertainty or undetermined combinations dominate
    (`known_u`).

    Args:
        about_mean: return uncertainties of positions less their mean.

    Raises:
        KinematicsError: names the first impossible pose.
        ModelError: a source needs missing data.
    """
    sensitivity, silent = _sensitivity(identified, motion)
    unseen = identified.unseen
    if about_mean:
        sensitivity, silent = (one - one.mean(axis=1, keepdims=True) for one in (sensitivity, silent))
    variance = np.einsum("aij,jk,aik->ia", sensitivity, identified.covariance, sensitivity)
    along = np.where(np.any(np.abs(silent) > ROUNDING_MM, axis=2), np.inf, 0.0).T
    if unseen is None or not identified.covariance_rows:
        along += np.inf
    else:
        along += np.sum((sensitivity @ unseen.T) ** 2, axis=2).T
    return known_u(np.maximum(variance, 0.0), along)


@with_one_thread
def range_uncertainty_mm(identified: IdentifiedModel, motion: Motion, axis: int) -> float | None:
    """Return the standard uncertainty of the range along one axis [mm], to first order from its two extreme poses; None if unknown.

    Raises:
        KinematicsError: names the first impossible pose.
        ModelError: a source needs missing data.
    """
    actual = identified.model.of_the_machine().actual_poses(motion)
    off = actual[:, axis] - motion.poses[motion.kept][:, axis]
    ends = motion.poses[motion.kept][[place_of_largest(off), int(np.argmin(off))]]
    # Each extreme pose is half the range from their mean.
    half = position_uncertainty_mm(identified, Motion(ends), about_mean=True)[0, axis]
    return None if np.isnan(half) else 2.0 * float(half)


ROUNDING_MM = 1e-9
"""Smaller tool movements per unit of a parameter are rounding [mm]."""


def _sensitivity(identified: IdentifiedModel, motion: Motion) -> tuple[Floats, Floats]:
    """Return sensitivities of X, Y and Z to covariance rows, shape (3, n, k), and to sources without uncertainty."""
    model = identified.model.of_the_machine()
    actual = model.actual(motion)
    row_of = {row: k for k, row in enumerate(identified.covariance_rows)}
    stated = {(source, shared) for source, shared, _ in row_of}
    responses = position_responses(actual.hexapod, actual.frames)
    count = len(motion.poses[motion.kept])
    sensitivity = np.zeros((3, count, len(row_of)))
    silent = [np.zeros((3, count, 0))]
    for fitted in model.acting(motion):
        derivative = actual.derivative(fitted)
        names = fitted.rows(model.machine)
        columns = [row_of[name] for name in names if name in row_of]
        known = [k for k, name in enumerate(names) if name in row_of]
        whole = np.array(
            [np.broadcast_to(by_parameters(derivative, r, motion.kept), (count, len(names))) for r in responses]
        )
        sensitivity[:, :, columns] = whole[:, :, known]
        if (fitted.source.name, fitted.shared) not in stated:
            silent.append(whole)
    return sensitivity, np.concatenate(silent, axis=2)


POSES_AT_ONCE = 5_000
"""Poses predicted together: few enough for memory and for progress messages."""


@with_one_thread
def predicted_poses(
    identified: IdentifiedModel,
    poses: ArrayLike,
    progress: Counted = uncounted,
) -> tuple[Floats, Floats]:
    """Return actual poses, shape (n, 6) [mm, deg], of single commands, and standard uncertainties of X, Y, Z, shape (n, 3) [mm]; NaN if unknown.

    Args:
        poses: shape (n, 6) [mm, deg], any numeric type.

    Raises:
        KinematicsError: names an impossible pose.
        ModelError: a source needs more than poses.
    """
    commanded = np.array(poses, dtype=np.float64)
    actual, known = np.empty_like(commanded), np.empty((len(commanded), 3))
    model = identified.model.of_the_machine()
    for first in range(0, len(commanded), POSES_AT_ONCE):
        progress(first, len(commanded))
        some = slice(first, first + POSES_AT_ONCE)
        motion = Motion(commanded[some])
        try:
            actual[some] = model.actual_poses(motion)
        except KinematicsError:
            model.actual_poses(Motion(commanded))  # raises again, with the pose's number among all poses
            raise
        known[some] = position_uncertainty_mm(identified, motion)
    progress(len(commanded), len(commanded))
    return actual, known


def greatest_u_um(identified: IdentifiedModel, poses: ArrayLike) -> tuple[float | None, float | None, float | None]:
    """Return the greatest standard uncertainties of X, Y and Z over poses [µm], from pose-dependent sources; None if one is unknown."""
    anywhere = replace(identified, model=identified.model.anywhere())
    x, y, z = (None if np.isnan(u) else 1e3 * float(u) for u in predicted_poses(anywhere, poses)[1].max(axis=0))
    return x, y, z


@dataclass(frozen=True)
class PoseErrors:
    """Statistics of predicted position errors, with their uncertainty.

    Attributes:
        common_shift_um: mean error, X, Y, Z.
        error_about_mean_rms_um: rms without the common shift.
        greatest_uncertainty_um: standard, over all axes; None if unknown.
    """

    greatest_error_um: float
    error_rms_um: float
    common_shift_um: tuple[float, ...]
    error_about_mean_rms_um: float
    greatest_uncertainty_um: float | None
    greatest_uncertainty_by_axis_um: Mapping[str, float | None]


def pose_errors(commanded: Floats, actual: Floats, uncertainty_mm: Floats) -> PoseErrors:
    """Return position errors of predicted poses."""
    off_um = 1e3 * (actual[:, :3] - commanded[:, :3])
    shift_um = off_um.mean(axis=0)
    greatest_um = 1e3 * uncertainty_mm.max(axis=0)
    whole_um = 1e3 * float(np.linalg.norm(uncertainty_mm, axis=1).max())
    return PoseErrors(
        greatest_error_um=float(np.linalg.norm(off_um, axis=1).max()),
        error_rms_um=rms_length(off_um),
        common_shift_um=tuple(shift_um.tolist()),
        error_about_mean_rms_um=rms_length(off_um - shift_um),
        greatest_uncertainty_um=None if np.isnan(whole_um) else whole_um,
        greatest_uncertainty_by_axis_um={
            axis: None if np.isnan(u) else u for axis, u in zip("xyz", greatest_um.tolist(), strict=True)
        },
    )


def rms_length(vectors: Floats) -> float:
    """Return the rms length of vectors, shape (n, 3), in their unit."""
    return sqrt(np.mean(np.sum(vectors**2, axis=1)))
