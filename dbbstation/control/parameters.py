"""Fit parameters and joint tables of LinuxCNC's genhexkins to a model over a volume.

Genhexkins drives joint i to |T + R a_i - b_i|, with platform joints a and base joints b; a table adds to a joint's
position. Wrong joints imitate other errors, so fitted values describe a control, never the machine.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUTS, Frames
from dbbstation.machine.kinematics import Struts, forward, inverse, strut_jacobian
from dbbstation.model.compensation import compensated
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.causes.base_joints import BaseJoints
from dbbstation.sources.causes.platform_joints import PlatformJoints
from dbbstation.sources.causes.strut_reference_length import StrutReferenceLength
from dbbstation.sources.contract import Fitted, Motion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

FITTED, TRIED = 400, 2000
"""Poses to which parameters are fitted, and other poses at which the remaining errors are measured.
Errors left by 42 values are then 1.66 to 1.73 µm rms over three draws, 1.65 to 1.66 µm with 1600 poses to fit, 1.79 to 1.87 with
100 [reference machine with gravity, lead and cyclic errors]."""

LEVER_MM = 100.0
"""Lever arm that converts tilt to a displacement: the distance from the tool tip of, for example, a part's far end [mm]."""

POINTS = 256
"""Most triplets that LinuxCNC takes in a `COMP_FILE` [EMCMOT_COMP_SIZE]."""

PER_WAVE = 4
"""Least table points per wave, linearly interpolated: with four, a fifth of the wave's rms remains; with three, more than a third."""

BEYOND_MM = 5.0
"""How far tables go beyond the struts' lengths in the volume; beyond their ends LinuxCNC holds the last value [mm]."""

LOST = 1e-7
"""Relative singular value below which a parameter direction keeps its typed values: a millimetre along it moves the
tool by less than a nanometre."""

JOINTS = 3 * STRUTS

ROUNDS = 4
"""Gauss-Newton steps: joints wrong by millimetres converge in three."""


@dataclass(frozen=True, eq=False)
class Values:
    """Parameters of genhexkins.

    Attributes:
        base_mm: base joints less nominal, shape (6, 3).
        platform_mm: platform joints less nominal, shape (6, 3).
        longer_mm: actual less counted strut lengths, shape (6,).
        points_mm: positions of joints, shape (k,).
        table_mm: corrections at these positions, shape (6, k); zeros for no tables.
    """

    base_mm: Floats
    platform_mm: Floats
    longer_mm: Floats
    points_mm: Floats
    table_mm: Floats

    def joints(self, machine: Machine, frames: Frames) -> Floats:
        """Return the driven lengths at frames, shape (n, 6) [mm]."""
        joint = inverse(machine.hexapod.moved(self.base_mm, self.platform_mm), frames).length_mm
        added = [np.interp(joint[:, i], self.points_mm, self.table_mm[i]) for i in range(STRUTS)]
        return joint - self.longer_mm + np.column_stack(added)

    def sources(self) -> tuple[Fitted, ...]:
        """Return the correction as sources, with separate ones for tables."""
        return (
            Fitted(StrutReferenceLength(), self.longer_mm),
            Fitted(BaseJoints(), self.base_mm.reshape(-1)),
            Fitted(PlatformJoints(), self.platform_mm.reshape(-1)),
        )


@dataclass(frozen=True)
class LeftOfModel:
    """Remaining errors of the tool over a volume with one set-up of the control: position [µm] and tilt [deg], rms and largest."""

    way: str
    rms_um: float
    largest_um: float
    tilt_rms_deg: float
    tilt_largest_deg: float


@dataclass(frozen=True)
class SourceLeft:
    """Tool errors by one source alone, before and after correction by parameters and tables [µm rms].

    Attributes:
        held_by: `parameters`, `table` or `nothing`; errors are None if they were not fitted.
    """

    name: str
    rms_um: float | None
    left_rms_um: float | None
    held_by: str


@dataclass(frozen=True, eq=False)
class Refitted:
    """Fitted parameters, with the remaining errors."""

    values: Values
    left: tuple[LeftOfModel, ...]
    sources: tuple[SourceLeft, ...]


def drawn_poses(low: Floats, high: Floats, count: int, seed: int) -> Floats:
    """Return uniformly drawn poses between limits of shape (6,), shape (count, 6) [mm, deg]."""
    return np.random.default_rng(seed).uniform(low, high, (count, 6))


def refitted(model: MachineModel, poses: Floats, others: Floats) -> Refitted:
    """Refit genhexkins to a model's sources that depend on the pose alone.

    Args:
        others: poses for measuring the remaining errors, shape (m, 6).

    Raises:
        KinematicsError: a pose that the machine cannot take.
    """
    own = model.anywhere()
    machine = own.as_found
    driven = exact_joints(own, poses)
    points = np.linspace(driven.min() - BEYOND_MM, driven.max() + BEYOND_MM, POINTS)
    in_table = tuple(f for f in own.sources if _in_table(f, machine, points))
    rest = replace(own, sources=tuple(f for f in own.sources if f not in in_table))
    typed = _typed(own, points)
    fitted_at, wanted = Frames.from_poses(poses, machine.hexapod.rotation), exact_joints(rest, poses)
    few, all_joints = (
        _with_tables(_fit(machine, typed, fitted_at, wanted, platform=platform), in_table, machine)
        for platform in (False, True)
    )
    nominal = np.zeros((STRUTS, 3))
    as_it_is = replace(typed, base_mm=nominal, platform_mm=nominal, longer_mm=machine.reference_length_error_mm)
    ways = {"as it is": as_it_is, "typed": typed, "24 refitted": few, "42 refitted": all_joints}
    at = Frames.from_poses(others, machine.hexapod.rotation)
    joints = {name: way.joints(machine, at) for name, way in ways.items()}
    joints["program or kinematics"] = exact_joints(own, others)
    left = tuple(_left(name, tool_errors(own, one, at)) for name, one in joints.items())
    sources = _by_source(own, in_table, poses, driven, typed)
    return Refitted(all_joints, left, sources)


def exact_joints(model: MachineModel, poses: Floats) -> Floats:
    """Return driven strut lengths, shape (n, 6) [mm], that bring the model exactly to the poses."""
    commands = compensated(model, Motion(poses))
    return model.driven_mm(Frames.from_poses(commands, model.machine.hexapod.rotation))


def tool_errors(model: MachineModel, joints: Floats, wanted: Frames) -> Floats:
    """Return the tool's errors at driven lengths: X, Y, Z [mm] and turn [rad], shape (n, 6)."""
    machine = model.machine
    command = forward(machine.hexapod, joints + machine.reference_length_error_mm, wanted)
    poses = command.to_poses(machine.hexapod.rotation)
    actual = model.actual(Motion(poses)).tool_frames()
    turned = actual.rotation @ np.swapaxes(wanted.rotation, 1, 2)
    turn = np.stack(
        [turned[:, 2, 1] - turned[:, 1, 2], turned[:, 0, 2] - turned[:, 2, 0], turned[:, 1, 0] - turned[:, 0, 1]]
    )
    return np.hstack([actual.position_mm - wanted.position_mm, turn.T / 2.0])


def _left(way: str, errors: Floats) -> LeftOfModel:
    off_um = 1e3 * np.linalg.norm(errors[:, :3], axis=1)
    tilt = np.degrees(np.linalg.norm(errors[:, 3:], axis=1))
    rms = [float(np.sqrt(np.mean(np.square(each)))) for each in (off_um, tilt)]
    return LeftOfModel(way, rms[0], float(off_um.max()), rms[1], float(tilt.max()))


def _typed(own: MachineModel, points: Floats) -> Values:
    of = {f.source.name: f.values for f in own.sources}
    return Values(
        of.get(BaseJoints.name, np.zeros(JOINTS)).reshape(STRUTS, 3),
        of.get(PlatformJoints.name, np.zeros(JOINTS)).reshape(STRUTS, 3),
        of.get(StrutReferenceLength.name, np.zeros(STRUTS)),
        points,
        np.zeros((STRUTS, POINTS)),
    )


@dataclass(frozen=True, eq=False)
class _AtLengths(Motion):
    """A motion with known strut lengths and unknown directions, shape (n, 6)."""

    length_mm: Floats = field(default_factory=lambda: np.zeros((0, STRUTS)))

    def struts(self, machine: Machine) -> Struts:  # noqa: ARG002 - lengths are given
        nowhere = np.full((*self.length_mm.shape, 3), np.nan)
        return Struts(self.length_mm, nowhere, nowhere)


def _by_length(fitted: Fitted, machine: Machine, length_mm: Floats) -> Floats | None:
    """Return a source's strut errors at lengths, shape (n, 6) [mm]; None if they depend on more than strut length."""
    form = fitted.source.c_form(machine, fitted.values)
    if form is None or form.by_pose:
        return None
    motion = _AtLengths(np.zeros((len(length_mm), 6)), length_mm=length_mm)
    strut = fitted.source.effect(motion, machine, fitted.values).strut_mm
    return None if strut is None or strut.ndim == 1 else strut


def _in_table(fitted: Fitted, machine: Machine, points: Floats) -> bool:
    fine = fitted.source.shortest_period_mm(machine, fitted.values) < PER_WAVE * float(points[1] - points[0])
    return not fine and _by_length(fitted, machine, np.full((2, STRUTS), points[0])) is not None


def _with_tables(values: Values, in_table: Sequence[Fitted], machine: Machine) -> Values:
    table = np.zeros((STRUTS, POINTS))
    for _ in range(2):
        at = (values.points_mm + (machine.reference_length_error_mm - values.longer_mm)[:, None] + table).T
        errors = [_by_length(fitted, machine, at) for fitted in in_table]
        table = -sum((each.T for each in errors if each is not None), np.zeros((STRUTS, POINTS)))
    return replace(values, table_mm=table)


def _effects(machine: Machine, values: Values, frames: Frames) -> tuple[Floats, Floats]:
    """Return two derivatives: of joints by the 42 parameters, (n, 6, 42), and of the tool by joints, (n, 6, 6), turns times the lever."""
    struts = inverse(machine.hexapod.moved(values.base_mm, values.platform_mm), frames)
    own = np.eye(STRUTS)[:, :, None]
    base = -struts.unit[:, :, None, :] * own
    platform = np.einsum("nji,nkj->nki", frames.rotation, struts.unit)[:, :, None, :] * own
    longer = np.broadcast_to(-np.eye(STRUTS), (len(frames), STRUTS, STRUTS))
    by_values = np.concatenate([longer, *(each.reshape(len(frames), STRUTS, -1) for each in (base, platform))], axis=2)
    tool = np.linalg.inv(strut_jacobian(struts))
    tool[:, 3:] *= LEVER_MM
    return by_values, np.asarray(tool, dtype=np.float64)


def _fit(machine: Machine, start: Values, frames: Frames, wanted: Floats, *, platform: bool) -> Values:
    values, used = start, slice(None if platform else STRUTS + JOINTS)
    for _ in range(ROUNDS):
        by_values, tool = _effects(machine, values, frames)
        by_parameter = (tool @ by_values[:, :, used]).reshape(wanted.size, -1)
        lacking = np.einsum("nij,nj->ni", tool, wanted - values.joints(machine, frames)).reshape(-1)
        step = np.zeros(STRUTS + 2 * JOINTS)
        step[used] = np.linalg.lstsq(by_parameter, lacking, rcond=LOST)[0]
        longer, base, end = np.split(step, [STRUTS, STRUTS + JOINTS])
        values = replace(
            values,
            longer_mm=values.longer_mm + longer,
            base_mm=values.base_mm + base.reshape(STRUTS, 3),
            platform_mm=values.platform_mm + end.reshape(STRUTS, 3),
        )
    return values


def _by_source(
    own: MachineModel,
    in_table: Sequence[Fitted],
    poses: Floats,
    driven: Floats,
    values: Values,
) -> tuple[SourceLeft, ...]:
    machine = own.as_found
    frames = Frames.from_poses(poses, machine.hexapod.rotation)
    by_values, tool = _effects(machine, values, frames)
    columns = (tool @ by_values).reshape(6 * len(poses), -1)
    found = []
    for fitted in own.sources:
        without = MachineModel(machine, tuple(f for f in own.sources if f is not fitted))
        off = driven - exact_joints(without, poses)
        errors = np.einsum("nij,nj->ni", tool, off).reshape(-1)
        if fitted in in_table:
            flat = replace(values, longer_mm=machine.reference_length_error_mm)
            table = _with_tables(flat, (fitted,), machine)
            left = np.einsum("nij,nj->ni", tool, off - (table.joints(machine, frames) - flat.joints(machine, frames)))
        else:
            left = errors - columns @ np.linalg.lstsq(columns, errors, rcond=LOST)[0]
        held = "table" if fitted in in_table else "parameters"
        found.append(SourceLeft(fitted.source.name, _rms_um(errors), _rms_um(left), held))
    return tuple(found)


def _rms_um(errors: Floats) -> float:
    return float(1e3 * np.sqrt(np.mean(np.sum(np.square(errors.reshape(-1, 6)[:, :3]), axis=1))))


def hal_lines(values: Values, machine: Machine) -> tuple[str, ...]:
    """Return `setp` lines for genhexkins: joints of base and platform [mm]."""
    actual = machine.hexapod.moved(values.base_mm, values.platform_mm)
    both = (("base", actual.base_joints_mm), ("platform", actual.platform_joints_mm))
    return tuple(
        f"setp genhexkins.{end}.{i}.{axis} {joints[i, k]:.6f}"
        for end, joints in both
        for i in range(STRUTS)
        for k, axis in enumerate("xyz")
    )


def home_mm(values: Values, machine: Machine) -> Floats:
    """Return the addition to HOME and HOME_OFFSET of each joint, shape (6,) [mm]."""
    return values.longer_mm - machine.reference_length_error_mm


def tables(values: Values, play_mm: Floats) -> tuple[str, ...]:
    """Return each joint's `COMP_FILE` of `COMP_FILE_TYPE` 1: position, trim upwards and trim downwards [mm]; none if all are zero."""
    if not values.table_mm.any() and not play_mm.any():
        return ()
    return tuple(
        "".join(
            f"{at:.6f} {trim + play / 2.0:.6f} {trim - play / 2.0:.6f}\n"
            for at, trim in zip(values.points_mm, table, strict=True)
        )
        for table, play in zip(values.table_mm, play_mm, strict=True)
    )
