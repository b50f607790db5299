"""Find roots of several one-variable functions between bounds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats

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
            self.done, self.lost = True, 1 + int(np.argmax(away if away.any() else open_))

    def _between(self, width: Floats) -> Floats:
        """Return alternately the middle, limited by |f|, and the false position."""
        # False position is exact for the slope -1, as after a play.
        middle = self._low + 0.5 * width
        with np.errstate(invalid="ignore", divide="ignore"):
            false = self._low + width * self._low_value / (self._low_value - self._high_value)
        turn = (middle, self._high + self._high_value, self._low + self._low_value, false)[self._steps % 4]
        return np.where((turn > self._low) & (turn < self._high), turn, middle)
