"""Effects of causes on circles and workspace, and circles after their correction."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Annotated

import numpy as np

from dbbstation.calibration.fit.calibrate import KINEMATIC_SOURCES, MEASUREMENT_SOURCES
from dbbstation.calibration.reporting.figures import identified_model
from dbbstation.calibration.reporting.prediction import smooth_circularities_um
from dbbstation.computing.threads import with_one_thread
from dbbstation.errors import KinematicsError
from dbbstation.facts import OfRun
from dbbstation.facts.serialise import Array, AsItIs, Kept
from dbbstation.facts.value import finite
from dbbstation.inference.bounds import BOUNDS
from dbbstation.machine.kinematics import position_responses
from dbbstation.machine.travel import reachable
from dbbstation.model.identified import known_u, position_uncertainty_mm, rms_length
from dbbstation.model.machine_model import by_parameters
from dbbstation.sources.contract import Motion, Need, Owner
from dbbstation.trace.analysis import figures, figures_of
from dbbstation.trace.recording import RawCircle

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.identified import Row
    from dbbstation.model.machine_model import BarReading, MachineModel
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import Fitted


REACH = 0.6
"""Compared share of the travel about its middle; the corners are hardly used."""

TILTS_DEG = ((0.0, 0.0), (15.0, 0.0), (-15.0, 0.0), (0.0, 15.0), (0.0, -15.0))


@dataclass(frozen=True)
class WorkspaceError:
    """Difference of tool position between the earlier calibration and the joint model, over the workspace.

    Attributes:
        error_greatest_um: greatest difference after subtracting the common shift.
        at_pose: pose of the greatest error, X, Y, Z, A, B, C [mm, deg].
        uncertainty_rms_um: rms standard uncertainty of the joint model without the common shift; None if unknown.
        common_shift_um: mean error along X, Y and Z, which a program's zero on the part removes.
        uncertainty_with_shift_rms_um: None if unknown.
    """

    error_rms_um: float
    error_greatest_um: float
    at_pose: tuple[float, ...]
    uncertainty_rms_um: float | None
    common_shift_um: tuple[float, ...]
    error_with_shift_rms_um: float
    uncertainty_with_shift_rms_um: float | None


def workspace_error(before: Calibration, after: Calibration) -> WorkspaceError | None:
    """Compare two calibrations of one machine over the workspace; None if no pose is within travel.

    Only sources that depend on the pose alone are compared, because drift and backlash have no fixed place.
    """
    machine = before.layout.machine
    poses = workspace(machine)
    if len(poses) == 0:
        return None
    motion = Motion(poses)
    was, now = (c.model.anywhere().actual_poses(motion)[:, :3] for c in (before, after))
    apart_um = 1e3 * (was - now)
    shift_um = apart_um.mean(axis=0)
    length_um = np.linalg.norm(apart_um - shift_um, axis=1)
    worst = int(np.argmax(length_um))
    identified = identified_model(after, {}, {})
    identified = replace(identified, model=identified.model.anywhere())
    own_um, own_with_shift_um = (
        1e3 * rms_length(position_uncertainty_mm(identified, motion, about_mean=about)) for about in (True, False)
    )
    return WorkspaceError(
        error_rms_um=rms_length(apart_um - shift_um),
        error_greatest_um=float(length_um[worst]),
        at_pose=tuple(poses[worst].tolist()),
        uncertainty_rms_um=finite(own_um),
        common_shift_um=tuple(shift_um.tolist()),
        error_with_shift_rms_um=rms_length(apart_um),
        uncertainty_with_shift_rms_um=finite(own_with_shift_um),
    )


def workspace(machine: Machine) -> Floats:
    """Return reachable poses over the inner travel, shape (n, 6) [mm, deg]."""
    travel = machine.travel
    middle = sum(travel.z_mm) / 2.0
    across = np.linspace(-REACH, REACH, BOUNDS.workspace_steps) * travel.xy_radius_mm
    up = middle + np.linspace(-REACH, REACH, BOUNDS.workspace_steps) * (travel.z_mm[1] - travel.z_mm[0]) / 2.0
    x, y, z, tilt = np.meshgrid(across, across, up, np.arange(len(TILTS_DEG)), indexing="ij")
    tilts = np.array(TILTS_DEG)[tilt.ravel()]
    poses = np.column_stack([x.ravel(), y.ravel(), z.ravel(), tilts, np.zeros(len(tilts))])
    inside = np.hypot(poses[:, 0], poses[:, 1]) <= REACH * travel.xy_radius_mm + 1e-9
    return reachable(machine, poses[inside])


GEOMETRY = "geometry"
"""Name of all kinematic parameters as one cause, because one calibration corrects them together."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CuredCircle(OfRun):
    """One run with and without a cause; G up to 30 undulations per revolution.

    Attributes:
        g_um: circular deviation of the cause alone.
        centre_um: shift of the centre, X and Y, shape (2,).
        measured_centre_um: measured less commanded centre, shape (2,).
        cured_centre_um: the same without the cause, shape (2,).
    """

    g_um: float
    centre_um: Array
    measured_g_um: float
    cured_g_um: float
    measured_centre_um: Array
    cured_centre_um: Array
    raw: Annotated[RawCircle, AsItIs, Kept] = field(repr=False)
    effect_mm: Annotated[Array, Kept] = field(repr=False)


@dataclass(frozen=True, kw_only=True, eq=False)
class CauseEffect:
    """A cause's contribution over all runs.

    Attributes:
        cause: source, or `geometry` for all kinematic parameters.
        verdict: empty for geometry or without diagnosis.
        g_u_um: standard uncertainty; None if unknown.
        centre_u_um: standard uncertainty; None if unknown.
        workspace_um: rms tool shift over the workspace, less the common shift; None if the cause depends on more than the pose.
        workspace_u_um: standard uncertainty; None if unknown.
    """

    cause: str
    sources: tuple[str, ...]
    verdict: str = ""
    g_um: float
    g_u_um: float | None
    centre_um: float
    centre_u_um: float | None
    workspace_um: float | None
    workspace_u_um: float | None
    measured_g_um: float
    cured_g_um: float
    cure: str
    confirm: str
    runs: tuple[CuredCircle, ...]


COMPENSATION = "Compensate programs with the model (`dbbstation program`, `dbbstation compensate`), or enter the geometry into the control."
REMEASURE = (
    "measure the same circles under compensated programs: their centres and G come down to what is left of other causes"
)


@with_one_thread
def effects_of(
    model: MachineModel,
    observations: Sequence[Observation],
    rows: Sequence[Row] = (),
    covariance: Floats | None = None,
    unseen: Floats | None = None,
    formula_variance: Floats | None = None,
) -> tuple[CauseEffect, ...]:
    """Return contributions of causes, the greatest circular deviation first.

    An effect is the reading with minus without the cause. Effects add to first order; circular deviations need not.

    Args:
        covariance: in products of units, shape (k, k); None if unknown.
        unseen: undetermined combinations at plausible sizes, shape (h, k); if they dominate, the workspace uncertainty
            is unknown.
        formula_variance: part of the variances due to formulas, common to a source's amplitudes, shape (k,); or None.

    Raises:
        ModelError: a source needs missing data.
        TraceError: a run that is no circle.
    """
    lengths = [model.bar(observation.motion()) for observation in observations]
    found = []
    for name, group in _groups(model):
        without = replace(model, sources=tuple(f for f in model.sources if f not in group))
        effects = [
            whole.length_mm - without.bar(observation.motion()).length_mm
            for whole, observation in zip(lengths, observations, strict=True)
        ]
        if not any(np.abs(effect).max(initial=0.0) > ROUNDING_MM for effect in effects):
            continue
        places = _places(group, model, rows)
        roots = None
        if covariance is not None and places is not None:
            of_formulas = np.zeros(len(places)) if formula_variance is None else formula_variance[places]
            root = _root(covariance[np.ix_(places, places)] - np.diag(of_formulas))
            roots = _parted(group, np.hstack([root, _of_formulas(group, of_formulas)]))
        hidden = None if unseen is None or places is None else _parted(group, unseen[:, places].T)
        spread = None if roots is None else [_answers(o, lengths[k], group, roots) for k, o in enumerate(observations)]
        circles = tuple(_circle(o, effect) for o, effect in zip(observations, effects, strict=True))
        texts = group[0].source.texts
        space, space_u = _over_the_workspace(model, without, group, (roots, hidden))
        found.append(
            CauseEffect(
                cause=name,
                sources=tuple(dict.fromkeys(f.source.name for f in group)),
                g_um=float(np.mean([circle.g_um for circle in circles])),
                g_u_um=_u_of_mean(circles, spread, _changed_g_um),
                centre_um=float(np.mean([np.hypot(*circle.centre_um) for circle in circles])),
                centre_u_um=_u_of_mean(circles, spread, _changed_centres_um),
                workspace_um=space,
                workspace_u_um=space_u,
                measured_g_um=sum(circle.measured_g_um for circle in circles) / len(circles),
                cured_g_um=sum(circle.cured_g_um for circle in circles) / len(circles),
                cure=COMPENSATION if name == GEOMETRY else texts.cure,
                confirm=REMEASURE if name == GEOMETRY else texts.confirm,
                runs=circles,
            )
        )
    return tuple(sorted(found, key=lambda one: -one.g_um))


ROUNDING_MM = 1e-9
"""Effects below this are rounding [mm]."""


def _groups(model: MachineModel) -> Iterator[tuple[str, tuple[Fitted, ...]]]:
    geometry = tuple(f for f in model.sources if f.source.name in KINEMATIC_SOURCES)
    if geometry:
        yield GEOMETRY, geometry
    names = dict.fromkeys(
        f.source.name
        for f in model.sources
        if f.source.name not in {*KINEMATIC_SOURCES, *MEASUREMENT_SOURCES} and not f.source.of_currents
    )
    for name in names:
        own = tuple(f for f in model.sources if f.source.name == name)
        if any(f.source.found_compliance(model.machine, f.values) is not None for f in own):
            # Without elastic struts, loads have no effect.
            own = (*own, *(f for f in model.sources if f.source.loads_struts and f not in own))
        yield name, own


def _places(group: Sequence[Fitted], model: MachineModel, rows: Sequence[Row]) -> list[int] | None:
    place = {row: k for k, row in enumerate(rows)}
    names = [row for f in group for row in f.rows(model.machine)]
    return [place[name] for name in names] if all(name in place for name in names) else None


def _root(covariance: Floats) -> Floats:
    values, vectors = np.linalg.eigh(covariance)
    kept = values > 0.0
    root: Floats = vectors[:, kept] * np.sqrt(values[kept])
    return root


def _of_formulas(group: Sequence[Fitted], variance: Floats) -> Floats:
    """Return parameter changes due to formula errors, a column per source, shape (p, sources)."""
    sources = list(dict.fromkeys(f.source.name for f in group))
    owner = np.concatenate([np.full(len(f.values), sources.index(f.source.name)) for f in group])
    share = np.sqrt(variance) * np.sign(np.concatenate([f.values for f in group]))
    return share[:, None] * (owner[:, None] == np.arange(len(sources)))


def _parted(group: Sequence[Fitted], changes: Floats) -> tuple[Floats, ...]:
    """Return parameter changes, shape (p, r), separated by source."""
    ends = np.cumsum([len(f.values) for f in group])
    return tuple(np.split(changes, ends[:-1]))


def _answers(
    observation: Observation,
    reading: BarReading,
    group: Sequence[Fitted],
    roots: tuple[Floats, ...],
) -> Floats:
    """Return changes of the readings by independent parameter changes of one standard deviation, shape (n, r) [mm]."""
    total = np.zeros((len(reading.length_mm), roots[0].shape[1]))
    motion = observation.motion()
    for fitted, root in zip(group, roots, strict=True):
        if fitted.shared == fitted.source.shared_by(motion):
            total += reading.by_fitted(fitted) @ root
    return total


def _circle(observation: Observation, effect_mm: Floats) -> CuredCircle:
    raw = observation.raw
    measured, cured = raw.length_mm, raw.length_mm - effect_mm
    was, would = figures(raw, measured), figures(raw, cured)
    before, after = (1e3 * np.asarray(one.centre_mm) for one in (was, would))
    g_um, measured_g_um, cured_g_um = smooth_circularities_um(raw, [raw.circle.bar_mm + effect_mm, measured, cured])
    return CuredCircle(
        test=observation.test,
        direction=str(raw.circle.direction),
        repeat=observation.repeat,
        g_um=g_um,
        centre_um=before - after,
        measured_g_um=measured_g_um,
        cured_g_um=cured_g_um,
        measured_centre_um=before,
        cured_centre_um=after,
        raw=raw,
        effect_mm=effect_mm,
    )


def _u_of_mean(
    circles: Sequence[CuredCircle],
    spread: Sequence[Floats] | None,
    changed_um: Callable[[CuredCircle, list[Floats]], Floats],
) -> float | None:
    """Return the standard uncertainty of a figure's mean over all runs, from its changes with length; None if unknown."""
    if spread is None:
        return None
    found = []
    for circle, answers in zip(circles, spread, strict=True):
        length_mm = circle.raw.circle.bar_mm + circle.effect_mm
        found.append(changed_um(circle, [length_mm + change for change in answers.T]))
    each = np.array(found)
    return float(np.linalg.norm(each.mean(axis=0))) if each.size else 0.0


def _changed_g_um(circle: CuredCircle, lengths_mm: list[Floats]) -> Floats:
    return np.array(smooth_circularities_um(circle.raw, lengths_mm)) - circle.g_um


def _changed_centres_um(circle: CuredCircle, lengths_mm: list[Floats]) -> Floats:
    raw, own = circle.raw, circle.raw.circle.bar_mm + circle.effect_mm
    own_mm, *others_mm = (one.centre_mm for one in figures_of(raw, np.array([own, *lengths_mm])))
    moved = circle.centre_um + 1e3 * (np.reshape(others_mm, (-1, 2)) - own_mm)
    return np.hypot(*moved.T) - float(np.hypot(*circle.centre_um))


def _over_the_workspace(
    model: MachineModel,
    without: MachineModel,
    group: Sequence[Fitted],
    changes: tuple[tuple[Floats, ...] | None, tuple[Floats, ...] | None],
) -> tuple[float | None, float | None]:
    """Return a cause's rms tool shift less the common shift, with standard uncertainty [µm]; None if unknown."""
    if any(f.source.belongs_to is not Owner.MACHINE or not f.source.needs <= {Need.POSE} for f in group):
        return None, None
    motion = Motion(workspace(model.machine))
    if len(motion.poses) == 0:
        return None, None
    try:
        here = model.anywhere().actual(motion)
        moved = (here.tool_frames().position_mm - without.anywhere().actual(motion).tool_frames().position_mm).T
    except KinematicsError:
        return None, None
    rms_um = _rms_about_mean_um(moved)
    responses = position_responses(here.hexapod, here.frames)

    def spread(roots: tuple[Floats, ...]) -> float:
        answers = np.zeros((3, len(motion.poses), roots[0].shape[1]))
        for fitted, root in zip(group, roots, strict=True):
            derivative = here.derivative(fitted)
            each = [
                np.broadcast_to(by_parameters(derivative, one, motion.kept), (len(motion.poses), len(fitted.values)))
                for one in responses
            ]
            answers += np.array(each) @ root
        off = [_rms_about_mean_um(moved + answers[:, :, k]) - rms_um for k in range(answers.shape[2])]
        return float(np.linalg.norm(off))

    known, hidden = changes
    if known is None:
        return rms_um, None
    u = known_u(np.array([spread(known) ** 2]), np.array([0.0 if hidden is None else spread(hidden) ** 2]))[0]
    return rms_um, None if np.isnan(u) else float(u)


def _rms_about_mean_um(moved_mm: Floats) -> float:
    """Return the rms length of vectors, shape (3, n) [mm], about their mean [µm]."""
    return 1e3 * float(np.sqrt(np.mean(np.sum((moved_mm - moved_mm.mean(axis=1, keepdims=True)) ** 2, axis=0))))
