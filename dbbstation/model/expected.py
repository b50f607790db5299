"""Predict a circle's centre, mean reading and form before its fit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import hypot_of
from dbbstation.errors import ModelError
from dbbstation.machine.geometry import STRUTS, Frames
from dbbstation.model.identified import IdentifiedModel
from dbbstation.sources.contract import Need, Owner
from dbbstation.trace.expected import COEFFICIENTS, HIGHER, Expected, form_columns, local_columns
from dbbstation.trace.recording import averaged

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dbbstation.computing.arrays import Floats
    from dbbstation.model.machine_model import BarReading, MachineModel
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource, Motion

SECTORS = 72
"""Number of angles at which a circle is predicted, enough for centre and mean of a smooth form."""


def expected_circle(
    observation: Observation, known_by: MachineModel | IdentifiedModel, causes: Iterable[ErrorSource]
) -> Expected:
    """Return a run's expected circle with its covariance.

    Pose-dependent causes have their usual or stated sizes. An identified model replaces the machine's causes by its
    covariance and residual.

    Args:
        observation: only the angles of readings are used.
        causes: all known; the machine's are omitted if identified.

    Raises:
        KinematicsError: the machine cannot take the circle.
    """
    # A ball set up under the spindle has no independent place, but its circle has a radius.
    setup = replace(observation.setup, place_known=True, set_up_errors=None)
    sparse = replace(observation.with_samples(averaged(observation.raw, SECTORS)), setup=setup)
    motion = sparse.motion()
    identified = known_by if isinstance(known_by, IdentifiedModel) else None
    model = (known_by.model if isinstance(known_by, IdentifiedModel) else known_by).of_the_machine()
    reading = model.bar(motion)
    theta = np.radians(sparse.raw.theta_deg)
    fit = np.linalg.pinv(np.column_stack([np.cos(theta), np.sin(theta), np.ones(len(theta))]))
    start = np.radians(sparse.raw.circle.start_deg)
    to_form = 1e3 * np.linalg.pinv(form_columns(theta - start))
    to_local = 1e3 * np.linalg.pinv(local_columns(theta)) if len(theta) >= SECTORS else None
    long_mm = reading.length_mm - sparse.raw.circle.bar_mm
    off = fit @ long_mm
    shapes = form_columns(theta - start)[:, HIGHER]
    acting = list(_acting(reading, motion, model, identified, causes, shapes, observation.test))
    effects = [to_form @ cause.columns_mm for cause in acting]
    local = [] if to_local is None else [(one.key, to_local @ one.columns_mm) for one in acting if not one.at_a_pose]
    moves = [fit @ cause.columns_mm for cause in acting if cause.at_a_pose]
    again = [cause.scatters * effect @ effect.T for cause, effect in zip(acting, effects, strict=True)]
    covariance = sum((move @ move.T for move in moves), np.zeros((3, 3)))
    nothing = np.zeros((COEFFICIENTS, COEFFICIENTS))
    # A raised bar measures cos e times a horizontal shift.
    along = sparse.raw.circle.radius_mm / sparse.raw.circle.bar_mm
    scale = np.diag([1.0 / along, 1.0 / along, 1.0])
    mounting_mm = float(np.max(observation.setup.mounting_repeatability_mm))
    return Expected(
        centre_mm=(scale @ off)[:2],
        radial_mm=float(off[2]),
        covariance_mm2=scale @ covariance @ scale,
        place_known=observation.setup.place_known,
        mounting_mm=mounting_mm,
        reversals_deg=_reversals_deg(observation, model),
        form_um=to_form @ long_mm,
        effects_um={cause.key: effect for cause, effect in zip(acting, effects, strict=True)},
        local_um=dict(local),
        moving=frozenset(cause.key for cause in acting if cause.moving),
        again_um2=sum(again, nothing),
        late_um2=sum((effect @ effect.T for cause, effect in zip(acting, effects, strict=True) if cause.late), nothing),
        place_um=1e3 * hypot_of(mounting_mm, observation.setup.ball_uncertainty_mm),
    )


@dataclass(frozen=True, eq=False)
class _Acting:
    """One cause with its effect along a run.

    Attributes:
        key: name, and label of the runs that share its values.
        columns_mm: change of the reading by one standard deviation of each parameter, shape (n, p).
        at_a_pose: whether it depends on the pose alone.
        scatters: number of its variances in the difference of two runs: two if it varies with the mounting, one if it varies with time.
        late: whether it varies with time.
    """

    key: tuple[str, str]
    columns_mm: Floats
    at_a_pose: bool
    scatters: float = 0.0
    moving: bool = False
    late: bool = False


def _acting(
    reading: BarReading,
    motion: Motion,
    model: MachineModel,
    identified: IdentifiedModel | None,
    causes: Iterable[ErrorSource],
    shapes: Floats,
    test: str,
) -> Iterator[_Acting]:
    """Yield causes along a run; `shapes` are the second and third undulations, shape (n, 4)."""
    if identified is not None:
        yield from _of_model(reading, motion, model, identified)
        left_mm = 1e-3 * float(identified.report.get("residual_rms_um", 0.0))
        # The model's residual is part of the circle's form, equal in all its runs.
        yield _Acting(("left by the model", test), left_mm * np.column_stack(_as_circle(motion)), at_a_pose=True)
        yield _Acting(("left of the form by the model", test), left_mm * shapes, at_a_pose=False)
    for source in causes:
        of_machine = source.belongs_to is Owner.MACHINE
        # A model predicts the machine's place. Differences between directions and days keep their usual size.
        known = of_machine and identified is not None and source.needs <= {Need.POSE}
        # Single events are faults to be found; a sound run has no such event.
        if source.happens_once or source.of_currents or known or not source.needs <= {Need.POSE, Need.PATH, Need.TIME}:
            continue
        try:
            source.require(motion)
            stated = None if of_machine else source.stated_mm(motion)
            parameters = source.parameters(model.machine)
            usual = np.array([parameter.plausible for parameter in parameters])
            size = usual if stated is None else np.asarray(stated, dtype=np.float64)
            at_a_pose = source.needs <= {Need.POSE}
            # Unknown amplitudes are zero; parameters of timing, such as time constants, have their usual value.
            about = np.where([bool(parameter.grid) and not at_a_pose for parameter in parameters], usual, 0.0)
            columns = reading.by_source(source, model.machine, about) * size
        except ModelError:
            continue  # the machine file lacks an input of this cause
        if np.all(np.isfinite(columns)):
            late = source.varies_with == "time"
            scatters = 2.0 if source.belongs_to is Owner.MOUNTING else float(late)
            key = source.name, source.shared_by(motion)
            moving = Need.PATH in source.needs
            yield _Acting(key, columns, at_a_pose=at_a_pose, scatters=scatters, moving=moving, late=late)


def _as_circle(motion: Motion) -> tuple[Floats, Floats, Floats]:
    """Return changes of the reading by unit shifts along X and Y and by a longer bar, shape (n,) each."""
    assert motion.setup is not None  # noqa: S101 - observations have one
    off = motion.poses[motion.kept, :3] - motion.setup.fixed_ball_mm
    towards = off / np.linalg.norm(off, axis=1)[:, None]
    return towards[:, 0], towards[:, 1], np.ones(len(off))


def _of_model(
    reading: BarReading, motion: Motion, model: MachineModel, identified: IdentifiedModel
) -> Iterator[_Acting]:
    row_of = {row: k for k, row in enumerate(identified.covariance_rows)}
    columns, rows = [], []
    for fitted in model.acting(motion):
        names = fitted.rows(model.machine)
        known = [k for k, name in enumerate(names) if name in row_of]
        columns.append(reading.by_fitted(fitted)[:, known])
        rows += [row_of[names[k]] for k in known]
    if rows:
        by_parameter = np.hstack(columns)
        variance, axes = np.linalg.eigh(identified.covariance)
        root = axes * np.sqrt(np.maximum(variance, 0.0))
        yield _Acting(("model", ""), by_parameter @ root[rows], at_a_pose=True)
        # Parameters held at nominal have their usual size, as on an uncalibrated machine.
        if identified.unseen is not None:
            yield _Acting(("held by the model", ""), by_parameter @ identified.unseen[:, rows].T, at_a_pose=True)


def _reversals_deg(observation: Observation, model: MachineModel) -> tuple[float, ...]:
    theta_deg = np.arange(0.0, 360.0, 0.5)
    frames = Frames.from_poses(observation.raw.circle.poses(theta_deg), model.machine.hexapod.rotation)
    length = model.driven_mm(frames)
    before, behind = length - np.roll(length, 1, axis=0), np.roll(length, -1, axis=0) - length
    return tuple(
        float(theta_deg[k]) for strut in range(STRUTS) for k in np.flatnonzero((before * behind)[:, strut] <= 0.0)
    )
