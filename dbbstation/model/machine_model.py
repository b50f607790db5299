"""Predict the tool's actual place and a bar's reading from commands."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import place_of_largest
from dbbstation.errors import KinematicsError
from dbbstation.machine.geometry import STRUTS, Frames
from dbbstation.machine.kinematics import (
    BarSensitivity,
    Response,
    bar_sensitivity,
    forward,
    position_responses,
    strut_lengths,
)
from dbbstation.sources.contract import Effect, Fitted, Motion, Need, Owner

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Hexapod, Machine
    from dbbstation.sources.contract import ErrorSource

AGREED_MM = 1e-9
MOST_ROUNDS = 30
"""Most iterations of weights and pose: four or five converge; a machine that needs more is nearly loose."""


@dataclass(frozen=True, eq=False)
class MachineModel:
    """Nominal geometry plus error sources.

    Attributes:
        sources: error sources of machine and measurement; each acts on the motions that share its values.
    """

    machine: Machine
    sources: tuple[Fitted, ...] = ()

    def of_the_machine(self) -> MachineModel:
        """Return the model with only the machine's sources."""
        return replace(self, sources=tuple(f for f in self.sources if f.source.belongs_to is Owner.MACHINE))

    def anywhere(self) -> MachineModel:
        """Return the model with only sources that depend on the pose alone."""
        own = self.of_the_machine()
        return replace(own, sources=tuple(f for f in own.sources if f.source.needs <= {Need.POSE}))

    def effect(self, motion: Motion, there: Actual | None = None) -> Effect:
        """Return the effect of all sources, without sources of motor currents.

        Args:
            there: actual machine on which weights act; None for commanded poses of the nominal machine.

        Raises:
            ModelError: a source needs missing data.
        """
        return self.together(self.acting(motion), motion, there)

    def together(self, several: Iterable[Fitted], motion: Motion, there: Actual | None = None) -> Effect:
        """Return the joint effect of given sources; arguments as for `effect`."""
        total = Effect()
        for fitted in several:
            fitted.source.require(motion)
            here, machine = motion, self.as_found
            if there is not None and fitted.source.weighs:
                here, machine = there.seen_by(fitted.source, machine)
            total += here.seen(fitted.source, partial(fitted.source.effect, machine=machine, values=fitted.values))
        return total

    def acting(self, motion: Motion) -> tuple[Fitted, ...]:
        """Return sources that change pose or reading of this motion."""
        return tuple(f for f in self.sources if f.shared == f.source.shared_by(motion) and not f.source.of_currents)

    @cached_property
    def as_found(self) -> Machine:
        """Return the machine with the identified compliance."""
        found = [f.source.found_compliance(self.machine, f.values) for f in self.sources]
        return next((replace(self.machine, compliance=one) for one in found if one is not None), self.machine)

    @property
    def shortest_period_mm(self) -> float:
        """Return the shortest wave of the machine's sources [mm]; infinite without any."""
        own = (f for f in self.sources if f.source.belongs_to is Owner.MACHINE and f.values.any())
        return min((f.source.shortest_period_mm(self.machine, f.values) for f in own), default=math.inf)

    def driven_mm(self, frames: Frames) -> Floats:
        """Return the controller's strut lengths for commanded poses, shape (n, 6) [mm]."""
        return strut_lengths(self.machine.hexapod, frames) - self.machine.reference_length_error_mm

    def actual(self, motion: Motion) -> Actual:
        """Return the platform's actual frames: F^-1(driven + strut errors; actual joints) [CAL eq 2].

        Weights act on the machine at its actual place. Their effect is iterated from the commanded pose to a picometre;
        each iteration reduces the change to a thousandth, near loose poses to a hundredth.

        Raises:
            KinematicsError: the machine or its weights make a pose impossible; names the first.
            ModelError: a source needs missing data.
        """
        commanded = motion.frames(self.machine)
        driven = self.driven_mm(commanded)
        acting = self.acting(motion)
        weights = tuple(f for f in acting if f.source.weighs)
        firm = self.together((f for f in acting if not f.source.weighs), motion, None)

        def reached(effect: Effect, near: Frames) -> Actual:
            hexapod = actual_hexapod(self.machine.hexapod, effect)
            return Actual(self, motion, hexapod, forward(hexapod, driven + _strut_errors(effect), near), effect)

        bent = self.together(weights, motion, None)
        there = reached(firm + bent, commanded)
        if not weights:
            return there
        for _ in range(MOST_ROUNDS):
            last, bent = bent, self.together(weights, motion, there)
            change = _change_mm(bent, last)
            if change.max() < AGREED_MM:
                return there
            there = reached(firm + bent, there.frames)
        raise KinematicsError(
            "the machine finds no equilibrium under its weights",
            where=f"pose {place_of_largest(change) + 1}",
            remedy="check the masses and compliances of the machine file and of the model, and the commanded pose",
        )

    def actual_poses(self, motion: Motion) -> Floats:
        """Return actual tool tip poses of kept rows, shape (n, 6) [mm, deg]."""
        return self.actual(motion).tool_frames().to_poses(self.machine.hexapod.rotation)[motion.kept]

    def bar(self, motion: Motion) -> BarReading:
        """Return the bar's predicted readings about the fixed ball, with sensitivities, for kept rows.

        A ball set up under the spindle is at the tool tip's actual place at that time. Micrometer readings and the
        bar's calibration are included.
        """
        setup = motion.setup
        if setup is None:
            raise ValueError("a motion without a set-up has no bar")
        if motion.reading_mm is None and any(Need.READING in f.source.needs for f in self.sources):
            # Without measured positions, the encoder is at the place that all other sources predict.
            others = replace(self, sources=tuple(f for f in self.sources if Need.READING not in f.source.needs))
            motion = replace(motion, reading_mm=others.bar(replace(motion, kept=slice(None))).length_mm)
        actual = self.actual(motion)
        standing: Actual | None = None
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
        length = sensitivity.length_mm + reading + setup.bar_reads_long_mm
        return BarReading(actual, length[motion.kept], sensitivity, standing, ball_response)


@dataclass(frozen=True, eq=False)
class Actual:
    """The actual machine along a motion."""

    model: MachineModel
    motion: Motion
    hexapod: Hexapod
    frames: Frames
    effect: Effect

    @cached_property
    def placed(self) -> Motion:
        """Return the motion at actual platform poses."""
        return self.motion.moved(self.frames.to_poses(self.hexapod.rotation))

    @cached_property
    def machine(self) -> Machine:
        """Return the machine with actual joints and compliance."""
        return replace(self.model.as_found, hexapod=self.hexapod)

    def seen_by(self, source: ErrorSource, machine: Machine) -> tuple[Motion, Machine]:
        """Return the motion and machine on which a source acts: actual poses for weights, commanded poses for others."""
        return (self.placed, replace(machine, hexapod=self.hexapod)) if source.weighs else (self.motion, machine)

    def by(self, fitted: Fitted) -> Effect:
        """Return one source's effect."""
        motion, machine = self.seen_by(fitted.source, self.model.as_found)
        return motion.seen(fitted.source, partial(fitted.source.effect, machine=machine, values=fitted.values))

    def derivative_of(self, source: ErrorSource, machine: Machine, values: Floats) -> Effect:
        """Return the derivative of a source's effect, shape (..., p); the source need not be in the model."""
        motion, machine = self.seen_by(source, machine)
        return motion.seen(source, partial(source.derivative, machine=machine, values=values), 1)

    def derivative(self, fitted: Fitted) -> Effect:
        """Return the effect's derivative by one source's parameters, shape (..., p).

        The stretch by other sources is proportional to a fitted compliance. The resulting motion of weights is omitted:
        a thousandth, near loose poses a hundredth. The omission costs a fit only iterations.

        Raises:
            ModelError: the source needs missing data.
        """
        source, values, found = fitted.source, fitted.values, self.model.as_found
        own = self.derivative_of(source, found, values)
        if source.found_compliance(self.model.machine, values) is None:
            return own
        stretch = Effect()
        for other in self.model.acting(self.motion):
            if other.source.loads_struts and other.values.any():
                stretch += self.by(other)
        if stretch.strut_mm is None:
            return own
        by_compliance = np.eye(len(values))[0] / values[0]
        return own + Effect(strut_mm=stretch.strut_mm[:, :, None] * by_compliance)

    def tool_frames(self) -> Frames:
        """Return actual tool tip frames."""
        tip = self.effect.tool_tip_mm
        if tip is None:
            return self.frames
        shift = np.einsum("nij,nj->ni", self.frames.rotation, np.broadcast_to(tip, (len(self.frames), 3)))
        return Frames(self.frames.position_mm + shift, self.frames.rotation)


@dataclass(frozen=True, eq=False)
class BarReading:
    """Predicted readings of one run.

    Attributes:
        length_mm: kept rows, shape (n,).
        sensitivity: all rows.
        standing: machine while a ball was set up under the spindle; else None.
        ball_response: sensitivities of this ball's X, Y and Z.
    """

    actual: Actual
    length_mm: Floats
    sensitivity: BarSensitivity
    standing: Actual | None = None
    ball_response: tuple[Response, ...] = ()

    def by_source(self, source: ErrorSource, machine: Machine, values: Floats) -> Floats:
        """Return the reading's derivative by a source's parameters at values of shape (p,): shape (n, p).

        The source need not be in the model.
        """
        return self._by(lambda actual: actual.derivative_of(source, machine, values))

    def by_fitted(self, fitted: Fitted) -> Floats:
        """Return the derivative by a model source's parameters, including its effect on other sources, shape (n, p)."""
        return self._by(lambda actual: actual.derivative(fitted))

    def _by(self, derivative: Callable[[Actual], Effect]) -> Floats:
        total = self.by_parameters(derivative(self.actual))
        if self.standing is None:
            return total
        then = derivative(self.standing)
        last = slice(len(self.standing.motion) - 1, None)
        moved = [np.broadcast_to(by_parameters(then, r, last), (1, total.shape[1])) for r in self.ball_response]
        return total - self.sensitivity.direction[self.actual.motion.kept] @ np.vstack(moved)

    def by_parameters(self, derivative: Effect) -> Floats:
        """Return the reading's derivative, shape (n, p), from the derivative of an effect; kept rows."""
        kept = self.actual.motion.kept
        total = by_parameters(derivative, self.sensitivity.response, kept)
        if derivative.fixed_ball_mm is not None:
            total = total - _contract(self.sensitivity.direction[kept], _rows(derivative.fixed_ball_mm, 1, kept), 1)
        if derivative.reading_mm is not None:
            total = total + _rows(derivative.reading_mm, 0, kept)
        parameters = np.shape(total)[-1] if np.ndim(total) else 0
        return np.ascontiguousarray(np.broadcast_to(total, (len(self.length_mm), parameters)))


def by_parameters(derivative: Effect, response: Response, kept: slice) -> Floats | float:
    """Return a quantity's derivative by parameters that act on struts, joints or tool, shape (n, p); 0.0 without effect."""
    total: Floats | float = 0.0
    if derivative.strut_mm is not None:
        total = total + _contract(response.per_strut[kept], _rows(derivative.strut_mm, 1, kept), 1)
    if derivative.base_joint_mm is not None:
        total = total + _contract(response.per_base_joint[kept], _rows(derivative.base_joint_mm, 2, kept), 2)
    if derivative.platform_joint_mm is not None:
        total = total + _contract(response.per_platform_joint[kept], _rows(derivative.platform_joint_mm, 2, kept), 2)
    if derivative.tool_tip_mm is not None:
        total = total + _contract(response.per_tool_ball[kept], _rows(derivative.tool_tip_mm, 1, kept), 1)
    return total


def _rows(array: Floats, axes: int, kept: slice) -> Floats:
    return array if array.ndim == axes + 1 else array[kept]


def _contract(gain: Floats, array: Floats, axes: int) -> Floats:
    count, parameters = len(gain), array.shape[-1]
    flat = gain.reshape(count, -1)
    if array.ndim == axes + 1:
        matrix = array.reshape(-1, parameters)
        if np.array_equal(matrix, np.eye(parameters)):  # joints and struts, with one parameter per coordinate
            return flat
        return flat @ matrix
    per_sample: Floats = np.einsum("ni,nip->np", flat, array.reshape(count, -1, parameters))
    return per_sample


def actual_hexapod(nominal: Hexapod, effect: Effect) -> Hexapod:
    """Return actual joints."""
    none = np.zeros((STRUTS, 3))
    return nominal.moved(
        none if effect.base_joint_mm is None else effect.base_joint_mm,
        none if effect.platform_joint_mm is None else effect.platform_joint_mm,
    )


def _strut_errors(effect: Effect) -> Floats:
    return np.zeros(STRUTS) if effect.strut_mm is None else effect.strut_mm


def _change_mm(bent: Effect, last: Effect) -> Floats:
    """Return the greatest change of a strut or joint between two weight effects, shape (n,) [mm]."""
    pairs = ((bent.strut_mm, last.strut_mm), (bent.base_joint_mm, last.base_joint_mm))
    changes = [np.abs(new - old) for new, old in pairs if new is not None and old is not None]
    greatest: Floats = np.max([np.max(c.reshape(len(c), -1), axis=1) for c in changes], axis=0)
    return greatest
