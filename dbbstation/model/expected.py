"""Where a circle should lie, before it is fitted: centre and mean reading with their uncertainty."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import STRUTS
from dbbstation.machine.rotation import Frames
from dbbstation.model.identified import IdentifiedModel
from dbbstation.quality.knowledge import Expected
from dbbstation.sources.contract import Need, Owner
from dbbstation.trace.average import averaged

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from dbbstation.model.machine_model import BarReading, MachineModel
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource, Motion

SECTORS = 72
"""Places of the turn at which a circle is predicted: centre and mean of a smooth form need no more."""


def expected_circle(
    observation: Observation, known_by: MachineModel | IdentifiedModel, causes: Iterable[ErrorSource]
) -> Expected:
    """Return where the circle of a run should lie.

    Of a model that was not identified nothing is known but what machines have: every cause that acts at a pose has its usual
    size, or the one that machine file or session state. Of an identified one its covariance is taken, and what it left of
    the recordings that it comes from.

    Args:
        observation: the run; of its readings nothing is used but the angles at which they were taken.
        known_by: the nominal machine, or a model that was identified.
        causes: all that are known; those of the machine are left out where the model was identified.

    Raises:
        KinematicsError: the machine cannot take the circle.
    """
    # A ball that was put up under the spindle has no place of its own; its circle has a radius like any other.
    setup = replace(observation.setup, place_known=True, set_up_errors=None)
    sparse = replace(observation, raw=averaged(observation.raw, SECTORS), commanded=None, setup=setup)
    motion = sparse.motion()
    identified = known_by if isinstance(known_by, IdentifiedModel) else None
    model = (known_by.model if isinstance(known_by, IdentifiedModel) else known_by).of_the_machine()
    reading = model.bar(motion)
    theta = np.radians(sparse.raw.theta_deg)
    fit = np.linalg.pinv(np.column_stack([np.cos(theta), np.sin(theta), np.ones(len(theta))]))
    off = fit @ (reading.length_mm - sparse.raw.circle.bar_mm)
    covariance = np.zeros((3, 3))
    for columns, of_parameters in _parts(reading, motion, model, identified, causes):
        effect = fit @ columns
        covariance += effect @ of_parameters @ effect.T
    # A raised bar sees cos e of a horizontal shift.
    along = sparse.raw.circle.radius_mm / sparse.raw.circle.bar_mm
    scale = np.diag([1.0 / along, 1.0 / along, 1.0])
    return Expected(
        centre_mm=(scale @ off)[:2],
        radial_mm=float(off[2]),
        covariance_mm2=scale @ covariance @ scale,
        place_known=observation.setup.place_known,
        mounting_mm=float(np.max(observation.setup.mounting_repeatability_mm)),
        reversals_deg=_reversals_deg(observation, model),
    )


def _parts(
    reading: BarReading,
    motion: Motion,
    model: MachineModel,
    identified: IdentifiedModel | None,
    causes: Iterable[ErrorSource],
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Derivatives of the reading by parameters, shape (n, p), with the covariance of these, shape (p, p)."""
    if identified is not None:
        yield from _of_model(reading, motion, model, identified)
        left_um = float(identified.report.get("residual_rms_um", 0.0))
        yield 1e-3 * left_um * np.column_stack(_as_circle(motion)), np.eye(3)
    for source in causes:
        of_machine = source.belongs_to is Owner.MACHINE
        if source.of_currents or not source.needs <= {Need.POSE} or (of_machine and identified is not None):
            continue
        try:
            source.require(motion)
            stated = None if of_machine else source.stated_mm(motion)
            usual = np.array([parameter.plausible for parameter in source.parameters(model.machine)])
            size = usual if stated is None else np.asarray(stated, dtype=np.float64)
            columns = reading.by_source(source, model.machine, np.zeros(len(usual)))
        except ModelError:
            continue  # the machine file does not have what it acts on
        if np.all(np.isfinite(columns)):
            yield columns, np.diag(size**2)


def _as_circle(motion: Motion) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """What a shift along X, one along Y and a longer bar do to a reading, shape (n,) each."""
    assert motion.setup is not None  # noqa: S101 - observations have one
    off = motion.poses[motion.kept, :3] - motion.setup.fixed_ball_mm
    towards = off / np.linalg.norm(off, axis=1)[:, None]
    return towards[:, 0], towards[:, 1], np.ones(len(off))


def _of_model(
    reading: BarReading, motion: Motion, model: MachineModel, identified: IdentifiedModel
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    row_of = {row: k for k, row in enumerate(identified.covariance_rows)}
    columns, rows = [], []
    for fitted in model.acting(motion):
        names = [(fitted.source.name, fitted.shared, p.name) for p in fitted.source.parameters(model.machine)]
        known = [k for k, name in enumerate(names) if name in row_of]
        columns.append(reading.by_fitted(fitted)[:, known])
        rows += [row_of[names[k]] for k in known]
    if rows:
        covariance = identified.covariance[np.ix_(rows, rows)]
        if (
            identified.unseen is not None
        ):  # what was held at nominal has its usual size, as of a machine that nobody calibrated
            covariance = covariance + identified.unseen[:, rows].T @ identified.unseen[:, rows]
        yield np.hstack(columns), covariance


def _reversals_deg(observation: Observation, model: MachineModel) -> tuple[float, ...]:
    """Angles of the circle at which a strut turns round [deg]."""
    theta_deg = np.arange(0.0, 360.0, 0.5)
    frames = Frames.from_poses(observation.raw.circle.poses(theta_deg), model.machine.hexapod.rotation)
    length = model.driven_mm(frames)
    before, behind = length - np.roll(length, 1, axis=0), np.roll(length, -1, axis=0) - length
    return tuple(
        float(theta_deg[k]) for strut in range(STRUTS) for k in np.flatnonzero((before * behind)[:, strut] <= 0.0)
    )
