"""The machine as it is: from what is commanded to where the tool goes and what a ball bar reads."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUTS
from dbbstation.machine.kinematics import (
    BarSensitivity,
    Response,
    bar_sensitivity,
    forward,
    position_responses,
    strut_lengths,
)
from dbbstation.machine.rotation import Frames
from dbbstation.sources.contract import Effect, Fitted, Motion, Need, Owner

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Hexapod, Machine
    from dbbstation.sources.contract import ErrorSource


@dataclass(frozen=True, eq=False)
class MachineModel:
    """Nominal geometry plus error sources.

    Attributes:
        machine: what the controller believes.
        sources: what is different, with its size; sources of every owner may stand here, and each acts on
            the motions that share its set.
    """

    machine: Machine
    sources: tuple[Fitted, ...] = ()

    def of_the_machine(self) -> MachineModel:
        """Return the model with the machine's own sources only: what holds for any program."""
        return replace(self, sources=tuple(f for f in self.sources if f.source.belongs_to is Owner.MACHINE))

    def effect(self, motion: Motion) -> Effect:
        """All sources together, but for those of motor currents, which change nothing else.

        Raises:
            ModelError: a source needs what the motion does not give.
        """
        total = Effect()
        for fitted in self.acting(motion):
            fitted.source.require(motion)
            total += fitted.source.effect(motion, self.as_found, fitted.values)
        return total

    def acting(self, motion: Motion) -> tuple[Fitted, ...]:
        """Sources that move the machine or the reading along a motion."""
        return tuple(f for f in self.sources if f.shared == f.source.shared_by(motion) and not f.source.of_currents)

    @cached_property
    def as_found(self) -> Machine:
        """The machine file with the compliance that a source found in place of its own: struts have one compliance."""
        found = [f.source.found_compliance(self.machine, f.values) for f in self.sources]
        return next((replace(self.machine, compliance=one) for one in found if one is not None), self.machine)

    def derivative(self, motion: Motion, fitted: Fitted) -> Effect:
        """Derivative of `effect` by the parameters of one of the sources, shape (..., p).

        Where that is the struts' compliance, the stretch that other sources count with it is in proportion to it.

        Raises:
            ModelError: the source needs what the motion does not give.
        """
        own = fitted.source.derivative(motion, self.as_found, fitted.values)
        if fitted.source.found_compliance(self.machine, fitted.values) is None:
            return own
        stretch = Effect()
        for other in self.acting(motion):
            if other.source.loads_struts and other.values.any():
                stretch += other.source.effect(motion, self.as_found, other.values)
        return own if stretch.strut_mm is None else own + Effect(strut_mm=stretch.strut_mm[:, :, None] / fitted.values)

    def driven_mm(self, frames: Frames) -> NDArray[np.float64]:
        """Strut lengths that the controller drives to for commanded poses, shape (n, 6) [mm]."""
        return strut_lengths(self.machine.hexapod, frames) - self.machine.reference_length_error_mm

    def actual(self, motion: Motion) -> Actual:
        """Where the platform really goes: F^-1(driven + strut errors; actual joints) [CAL eq 2].

        Raises:
            KinematicsError: names the first pose that the actual machine cannot take.
            ModelError: a source needs what the motion does not give.
        """
        commanded = Frames.from_poses(motion.poses, self.machine.hexapod.rotation)
        effect = self.effect(motion)
        hexapod = actual_hexapod(self.machine.hexapod, effect)
        frames = forward(hexapod, self.driven_mm(commanded) + _strut_errors(effect), commanded)
        return Actual(hexapod, frames, effect)

    def actual_poses(self, motion: Motion) -> NDArray[np.float64]:
        """Poses of the real tool tip, shape (n, 6) [mm, deg], for the rows that count."""
        return self.actual(motion).tool_frames().to_poses(self.machine.hexapod.rotation)[motion.kept]

    def bar(self, motion: Motion) -> BarReading:
        """What a bar about the motion's fixed ball reads, and how that answers to every error, kept rows only.

        A ball that was put up under the spindle stands where the tool tip really was then. What a micrometer read of
        both balls is taken into account.
        """
        setup = motion.setup
        if setup is None:
            raise ValueError("a motion without a set-up has no bar")
        if motion.reading_mm is None and any(Need.READING in f.source.needs for f in self.sources):
            # Nobody measured: the encoder stands where all other sources put it.
            others = replace(self, sources=tuple(f for f in self.sources if Need.READING not in f.source.needs))
            motion = replace(motion, reading_mm=others.bar(replace(motion, kept=slice(None))).length_mm)
        actual = self.actual(motion)
        ball, tool = setup.fixed_ball_mm, actual.effect.tool_tip_mm
        ball_response: tuple[Response, ...] = ()
        if motion.put_up is not None:
            standing = self.actual(motion.put_up)
            ball = standing.tool_frames().position_mm[-1]
            ball_response = position_responses(standing.hexapod, standing.frames)
            if setup.set_up_errors is not None:
                ball = ball + np.nan_to_num(setup.set_up_errors.fixed_ball_mm)
                moving = np.nan_to_num(setup.set_up_errors.moving_ball_mm)
                tool = moving if tool is None else tool + moving
        if actual.effect.fixed_ball_mm is not None:
            ball = ball + actual.effect.fixed_ball_mm
        sensitivity = bar_sensitivity(actual.hexapod, actual.frames, ball, tool)
        reading = np.zeros(1) if actual.effect.reading_mm is None else actual.effect.reading_mm
        length = sensitivity.length_mm + reading
        return BarReading(motion, length[motion.kept], sensitivity, ball_response)


@dataclass(frozen=True, eq=False)
class Actual:
    """Joints, platform poses and effects of the real machine along a motion."""

    hexapod: Hexapod
    frames: Frames
    effect: Effect

    def tool_frames(self) -> Frames:
        """Frames of the real tool tip: the platform's, shifted by what sits between platform and tip."""
        tip = self.effect.tool_tip_mm
        if tip is None:
            return self.frames
        shift = np.einsum("nij,nj->ni", self.frames.rotation, np.broadcast_to(tip, (len(self.frames), 3)))
        return Frames(self.frames.position_mm + shift, self.frames.rotation)


@dataclass(frozen=True, eq=False)
class BarReading:
    """Predicted readings of one run.

    Attributes:
        motion: the run.
        length_mm: predicted reading at the rows that count, shape (n,) [mm].
        sensitivity: at all rows of the motion.
        ball_response: how X, Y and Z of a ball that was put up under the spindle answer to the machine's errors, while
            it was put up.
    """

    motion: Motion
    length_mm: NDArray[np.float64]
    sensitivity: BarSensitivity
    ball_response: tuple[Response, ...] = ()

    def by_source(self, source: ErrorSource, machine: Machine, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivative of the reading by a source's parameters about their values, shape (p,): shape (n, p)."""
        return self._by(lambda motion: source.derivative(motion, machine, values))

    def by_fitted(self, model: MachineModel, fitted: Fitted) -> NDArray[np.float64]:
        """Derivative by the parameters of a source of a model, with what it changes through others, shape (n, p)."""
        return self._by(lambda motion: model.derivative(motion, fitted))

    def _by(self, derivative: Callable[[Motion], Effect]) -> NDArray[np.float64]:
        total = self.by_parameters(derivative(self.motion))
        if self.motion.put_up is None:
            return total
        then = derivative(self.motion.put_up)
        last = slice(len(self.motion.put_up) - 1, None)
        moved = [np.broadcast_to(by_parameters(then, r, last), (1, total.shape[1])) for r in self.ball_response]
        return total - self.sensitivity.direction[self.motion.kept] @ np.vstack(moved)

    def by_parameters(self, derivative: Effect) -> NDArray[np.float64]:
        """Derivative of the reading by p parameters, shape (n, p), from that of an effect; kept rows only."""
        kept = self.motion.kept
        total = by_parameters(derivative, self.sensitivity.response, kept)
        if derivative.fixed_ball_mm is not None:
            total = total - _contract(self.sensitivity.direction[kept], _rows(derivative.fixed_ball_mm, 1, kept), 1)
        if derivative.reading_mm is not None:
            total = total + _rows(derivative.reading_mm, 0, kept)
        parameters = np.shape(total)[-1] if np.ndim(total) else 0
        return np.ascontiguousarray(np.broadcast_to(total, (len(self.length_mm), parameters)))


def by_parameters(derivative: Effect, response: Response, kept: slice) -> NDArray[np.float64] | float:
    """Derivative of any quantity by p parameters through struts, joints and tool, shape (n, p); 0.0 where none."""
    total: NDArray[np.float64] | float = 0.0
    if derivative.strut_mm is not None:
        total = total + _contract(response.per_strut[kept], _rows(derivative.strut_mm, 1, kept), 1)
    if derivative.base_joint_mm is not None:
        total = total + _contract(response.per_base_joint[kept], _rows(derivative.base_joint_mm, 2, kept), 2)
    if derivative.platform_joint_mm is not None:
        total = total + _contract(response.per_platform_joint[kept], _rows(derivative.platform_joint_mm, 2, kept), 2)
    if derivative.tool_tip_mm is not None:
        total = total + _contract(response.per_tool_ball[kept], _rows(derivative.tool_tip_mm, 1, kept), 1)
    return total


def _rows(array: NDArray[np.float64], axes: int, kept: slice) -> NDArray[np.float64]:
    """Rows that count of a derivative that has one entry per sample; all of one that holds for every sample."""
    return array if array.ndim == axes + 1 else array[kept]


def _contract(gain: NDArray[np.float64], array: NDArray[np.float64], axes: int) -> NDArray[np.float64]:
    """Sum gain times array over struts and coordinates; the array is constant or has one entry per sample."""
    count, parameters = len(gain), array.shape[-1]
    flat = gain.reshape(count, -1)
    if array.ndim == axes + 1:
        matrix = array.reshape(-1, parameters)
        if np.array_equal(matrix, np.eye(parameters)):  # joints and struts: each coordinate its own parameter
            return flat
        return flat @ matrix
    per_sample: NDArray[np.float64] = np.einsum("ni,nip->np", flat, array.reshape(count, -1, parameters))
    return per_sample


def actual_hexapod(nominal: Hexapod, effect: Effect) -> Hexapod:
    """Joints with the effect's joint errors on them."""
    none = np.zeros((STRUTS, 3))
    return nominal.moved(
        none if effect.base_joint_mm is None else effect.base_joint_mm,
        none if effect.platform_joint_mm is None else effect.platform_joint_mm,
    )


def _strut_errors(effect: Effect) -> NDArray[np.float64]:
    return np.zeros(STRUTS) if effect.strut_mm is None else effect.strut_mm
