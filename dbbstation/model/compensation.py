"""Invert a machine model: find commands for wanted motion.

The path is inverted in successive stretches, which bounds computer memory. The states of play, friction and lag pass
from one stretch to the next.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import largest_size, place_of_largest
from dbbstation.errors import ModelError
from dbbstation.machine.geometry import Frames
from dbbstation.machine.kinematics import forward, strut_lengths
from dbbstation.model.machine_model import Actual, MachineModel, actual_hexapod
from dbbstation.sources.contract import Effect

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.sources.contract import Fitted, Motion, State


FIRST_STEP = 1.5
"""First step towards the other side of a zero, in units of the missing length."""

MOST_STEPS = 300
"""Most steps: a hundred halvings and two restarts."""

NARROW = 1e-12
"""Bounds so close enclose a jump without a zero [mm]."""

MOST_MM = 10.0
"""Search range about the first guess: the largest error of any machine [mm]."""

ANEW = 3


class RootSearch:
    """Finds x with f_i(x) = 0, if f_i decreases in x_i and hardly depends on the other arguments.

    Args:
        guess: start, shape (k,).
        met: |f| that counts as zero.

    Attributes:
        at: next argument; the root when `done`, shape (k,).
        lost: number, from 1, of the first function without zero near the guess; 0 if all have one.
    """

    def __init__(self, guess: Floats, met: float) -> None:
        self.at, self.done, self.lost = guess.copy(), False, 0
        self._guess, self._met = guess, met
        self._steps = self._anew = 0
        nothing = np.full(len(guess), np.nan)
        self._low, self._low_value, self._high, self._high_value, self._step = (nothing.copy() for _ in range(5))

    def tell(self, value: Floats) -> None:
        """Record f at `at`, shape (k,), and set the next argument."""
        open_ = np.abs(value) > self._met
        if not open_.any():
            self.done = True
            return
        self._steps += 1
        below = value > 0.0
        self._low = np.where(below, self.at, self._low)
        self._low_value = np.where(below, value, self._low_value)
        self._high = np.where(below, self._high, self.at)
        self._high_value = np.where(below, self._high_value, value)
        width = self._high - self._low
        held = ~np.isnan(width)
        narrow = held & (np.abs(width) < NARROW)
        if (narrow | ~open_).all():
            if self._anew < ANEW:
                self._anew += 1
                self._step = np.abs(value) * FIRST_STEP
                width, held = np.full_like(self.at, np.nan), np.zeros(len(self.at), bool)
                self._low, self._high = np.where(below, self.at, np.nan), np.where(below, np.nan, self.at)
                self._low_value, self._high_value = (np.where(s, value, np.nan) for s in (below, ~below))
            else:
                nearer = np.abs(self._low_value) < np.abs(self._high_value)
                self.at = np.where(narrow & open_, np.where(nearer, self._low, self._high), self.at)
                self.done = True
                return
        self._step = np.where(np.isnan(self._step), FIRST_STEP * np.abs(value), 2.0 * self._step)
        outwards = self.at + np.where(below, self._step, -self._step)
        self.at = np.where(open_, np.where(held, self._between(width), outwards), self.at)
        away = np.abs(self.at - self._guess) > MOST_MM
        if away.any() or self._steps > MOST_STEPS:
            self.done, self.lost = True, 1 + place_of_largest(away if away.any() else open_)

    def _between(self, width: Floats) -> Floats:
        """Return alternately the middle, limited by |f|, and the false position."""
        # False position is exact for the slope -1, as after a play.
        middle = self._low + 0.5 * width
        with np.errstate(invalid="ignore", divide="ignore"):
            false = self._low + width * self._low_value / (self._low_value - self._high_value)
        turn = (middle, self._high + self._high_value, self._low + self._low_value, false)[self._steps % 4]
        return np.where((turn > self._low) & (turn < self._high), turn, middle)


MOST_ROUNDS = 50
"""Most iterations. A pose-dependent error needs three or four: each reduces the difference to the ratio of error to travel, about 1e-4."""

AGREED_MM = 1e-10

MET_MM = 1e-9
"""Tolerance of strut lengths with sources that have memory: a thousandth of the resolution of programs."""

MOST_TOGETHER = 512
"""Most rows solved together after the last solved row."""

TRIES = 8
"""Most iterations for rows together; then the first unsolved row is searched alone."""

GETS_ON = 0.5
"""If an iteration leaves more than this share of the first unsolved row's error, this row is searched alone."""

FEWEST_TOGETHER = 16
"""Fewest rows solved together: an iteration over so many costs as much as over one."""

STEEPEST, FLATTEST = -3.0, -0.2
"""Bounds of the secant slope of a strut's missing length over its command; -1 if the error does not depend on the
command."""


@dataclass(frozen=True, eq=False)
class Passed:
    """A model's memory at the end of a stretch.

    Attributes:
        states: of sources with memory: accumulating sources first, otherwise in the model's order.
        held_back_mm: addition by these sources in the last row, at which the next search starts, shape (6,).
    """

    model: MachineModel
    states: tuple[State, ...]
    held_back_mm: Floats


def compensated(model: MachineModel, wanted: Motion) -> Floats:
    """Return commands, shape (n, 6) [mm, deg], that bring the machine to all wanted poses.

    Args:
        model: only the machine's sources are inverted.
        wanted: motion between commanded poses is straight, so predict it with `straight`.

    Raises:
        KinematicsError: a pose that the machine cannot take.
        ModelError: a source needs missing data or looks ahead; or no command leads to a pose.
    """
    return compensated_on(begun(model, wanted), wanted)[0]


def begun(model: MachineModel, wanted: Motion) -> Passed:
    """Return the memory at the start of a path.

    Args:
        model: only the machine's sources are inverted.
        wanted: the path, or its beginning, which gives directions of motion.

    Raises:
        ModelError: a source needs missing data, or looks ahead.
    """
    own = model.of_the_machine()
    motion = replace(wanted, straight=True)
    for fitted in own.acting(motion):
        fitted.source.require(motion)
        if fitted.source.looks_ahead:
            raise ModelError(
                f"the error source {fitted.source.name} cannot be compensated: its effect depends on later motion",
                remedy="leave it out of the model, or write its effect from the rows so far and set `looks_ahead` to False",
            )
    remembering = _with_history(own, motion)
    states = tuple(fitted.source.begin(motion, own.as_found, fitted.values) for fitted in remembering)
    return Passed(own, states, np.zeros(6))


def compensated_on(passed: Passed, wanted: Motion) -> tuple[Floats, Passed]:
    """Return commands along one stretch, shape (n, 6) [mm, deg], and the memory at its end.

    Raises:
        KinematicsError: a pose that the machine cannot take.
        ModelError: a source needs missing data; or no command leads to a pose.
    """
    # The command is the pose whose nominal strut lengths equal F(T wanted; actual) minus the sources' errors. Weights
    # act at wanted poses, other sources at commanded poses. Sources without memory converge in a few iterations.
    # Accumulating sources invert their own effect. Other sources with memory are solved for many rows together. If a
    # row fails, as at a reversal with play, it is searched alone by bisection for each strut.
    if len(wanted) == 0:
        return wanted.poses, passed
    stretch = _Stretch(passed, replace(wanted, straight=True))
    return stretch.commanded(stretch.with_history()), stretch.passed()


def _with_history(own: MachineModel, motion: Motion) -> tuple[Fitted, ...]:
    there = (f for f in own.acting(motion) if f.source.has_history)
    return tuple(sorted(there, key=lambda fitted: not fitted.source.builds_up))


class _Slope:
    def __init__(self) -> None:
        self._before: tuple[Floats, Floats] | None = None

    def step(self, driven: Floats, lacking: Floats) -> Floats:
        """Return the addition to a command, shape (k, 6) [mm]."""
        slope = np.full(driven.shape, -1.0)
        if self._before is not None:
            moved = driven - self._before[0]
            seen = np.abs(moved) > AGREED_MM
            slope = np.where(seen, (lacking - self._before[1]) / np.where(seen, moved, 1.0), slope)
        self._before = driven, lacking
        found: Floats = -lacking / np.clip(slope, STEEPEST, FLATTEST)
        return found


class _Stretch:
    def __init__(self, passed: Passed, wanted: Motion) -> None:
        self._own, self._held_back = passed.model, passed.held_back_mm
        self._machine = self._own.as_found
        self._nominal, self._convention = self._own.machine.hexapod, self._own.machine.hexapod.rotation
        self._wanted = wanted
        self._near = self._target = Frames.from_poses(wanted.poses, self._convention)
        acting = self._own.acting(wanted)
        self._weights = tuple(f for f in acting if f.source.weighs and not f.source.has_history)
        self._others = tuple(f for f in acting if not f.source.weighs and not f.source.has_history)
        remembering = _with_history(self._own, wanted)
        self._building_up = tuple(f for f in remembering if f.source.builds_up)
        self._searched = remembering[len(self._building_up) :]
        self._built_up, self._states = passed.states[: len(self._building_up)], passed.states[len(self._building_up) :]
        self._smooth, self._known = self._without_search()

    def commanded(self, driven: Floats) -> Floats:
        """Return poses at nominal lengths, shape (n, 6) [mm, deg]."""
        return forward(self._nominal, driven, self._near).to_poses(self._convention)

    def passed(self) -> Passed:
        """Return the memory after the last row."""
        return Passed(self._own, (*self._built_up, *self._states), self._held_back)

    def _without_search(self) -> tuple[Floats, Effect]:
        """Return driven lengths for sources that need no search, shape (n, 6) [mm], and the effect of weights and accumulating sources."""
        motion, last, bent = self._wanted, np.full((len(self._wanted), 6), np.inf), Effect()
        built_up = [np.zeros((len(self._wanted), 6)) for _ in self._building_up]
        there: Actual | None = None
        for _ in range(MOST_ROUNDS):
            bent = self._own.together(self._weights, motion, there)
            effect = bent + self._own.together(self._others, motion)
            platform = self._platform(effect, self._target)
            there = Actual(self._own, motion, actual_hexapod(self._nominal, effect), platform, effect)
            wanted = self._needed(effect, platform)
            for k, (fitted, state) in enumerate(zip(self._building_up, self._built_up, strict=True)):
                reached = self._driven_to(wanted - sum(built_up) + built_up[k], slice(None), self._target)
                built_up[k] = fitted.source.undone(motion, reached, self._machine, fitted.values, state)
            driven = wanted - sum(built_up)
            change = largest_size(driven - last)
            if change < AGREED_MM:
                break
            motion, last = self._driven_to(driven, slice(None), self._near), driven
            self._near = motion.frames(self._own.machine)
        if change > MET_MM:
            raise ModelError(
                f"the compensation does not settle: {change:.2e} mm after {MOST_ROUNDS} rounds",
                remedy="check the model's sources for an effect as large as the motion itself",
            )
        if not built_up:
            return driven, bent
        self._built_up = tuple(
            fitted.source.advance(motion, self._machine, fitted.values, state)[1]
            for fitted, state in zip(self._building_up, self._built_up, strict=True)
        )
        return driven, bent + Effect(strut_mm=sum(built_up, np.zeros_like(driven)))

    def with_history(self) -> Floats:
        """Return driven lengths for sources with memory, shape (n, 6) [mm]."""
        if not self._searched:
            return self._smooth
        count, row, together = len(self._wanted), 0, MOST_TOGETHER
        driven = np.empty_like(self._smooth)
        while row < count:
            rows = slice(row, min(row + together, count))
            found, met, states = self._tried(rows)
            if met == len(found):
                together = min(2 * together, MOST_TOGETHER)
            else:
                together = max(2 * met, FEWEST_TOGETHER)
                if met:
                    states = self._lacking(slice(row, row + met), found[:met])[1]
            driven[row : row + met] = found[:met]
            row += met
            self._go_on(states if met else self._states, driven, row)
            if met < len(found):
                driven[row], states = self._alone(row)
                row += 1
                self._go_on(states, driven, row)
        return driven

    def _go_on(self, states: tuple[State, ...], driven: Floats, row: int) -> None:
        self._states = states
        if row:
            self._held_back = driven[row - 1] - self._smooth[row - 1]

    def _tried(self, rows: slice) -> tuple[Floats, int, tuple[State, ...]]:
        """Solve rows together; return driven lengths, shape (k, 6) [mm], the number of solved rows, and the states after all rows."""
        smooth = self._smooth[rows]
        driven = smooth + self._held_back
        slope = _Slope()
        first, short_mm = -1, np.inf
        for _ in range(TRIES):
            lacking, states = self._lacking(rows, driven)
            missed = np.abs(lacking).max(axis=1) > MET_MM
            met = place_of_largest(missed) if missed.any() else len(missed)
            if met == len(missed):
                break
            before, (first, short_mm) = (first, short_mm), (met, largest_size(lacking[met]))
            if first == before[0] and short_mm > GETS_ON * before[1]:
                break
            last = driven
            driven = np.clip(driven + slope.step(driven, lacking), smooth - MOST_MM, smooth + MOST_MM)
        else:
            driven = last
        return driven, met, states

    def _alone(self, row: int) -> tuple[Floats, tuple[State, ...]]:
        """Search one row; return driven lengths, shape (1, 6) [mm], and the states after it."""
        rows = slice(row, row + 1)
        search = RootSearch((self._smooth[row] + self._held_back), MET_MM)
        while not search.done:
            search.tell(self._lacking(rows, search.at[None])[0][0])
        if search.lost:
            pose = ", ".join(
                f"{axis}{value:.3f}" for axis, value in zip("XYZABC", self._wanted.poses[row], strict=True)
            )
            raise ModelError(
                f"no command leads the machine to the pose {pose}: strut {search.lost} does not reach it",
                remedy="check the model's sources for an effect as large as the motion itself",
            )
        return search.at[None], self._lacking(rows, search.at[None])[1]

    def _lacking(self, rows: slice, driven: Floats) -> tuple[Floats, tuple[State, ...]]:
        """Return needed minus driven lengths for wanted poses, shape (k, 6) [mm], and the states after them."""
        target = Frames(self._target.position_mm[rows], self._target.rotation[rows])
        motion = self._driven_to(driven, rows, target)
        effect, states = self._known.rows(rows) + self._own.together(self._others, motion), []
        for fitted, state in zip(self._searched, self._states, strict=True):
            own, behind = fitted.source.advance(motion, self._machine, fitted.values, state)
            effect += own
            states.append(behind)
        return self._needed(effect, self._platform(effect, target)) - driven, tuple(states)

    def _driven_to(self, driven: Floats, rows: slice, near: Frames) -> Motion:
        return self._wanted.stretch(rows).commanded(forward(self._nominal, driven, near), self._own.machine)

    def _platform(self, effect: Effect, target: Frames) -> Frames:
        if effect.tool_tip_mm is None:
            return target
        tip = np.broadcast_to(effect.tool_tip_mm, (len(target), 3))
        return replace(target, position_mm=target.position_mm - np.einsum("nij,nj->ni", target.rotation, tip))

    def _needed(self, effect: Effect, platform: Frames) -> Floats:
        strut = 0.0 if effect.strut_mm is None else effect.strut_mm
        needed = strut_lengths(actual_hexapod(self._nominal, effect), platform)
        lengths: Floats = needed - strut + self._own.machine.reference_length_error_mm
        return lengths
