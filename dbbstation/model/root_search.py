"""Where several functions of one variable each are zero, between bounds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray  # noqa: TC002 - attributes are declared with it

FIRST_STEP = 1.5
"""Times what is missing: the first step to the other side of a zero."""

MOST_STEPS = 300
"""A hundred halvings of a bound, and twice begun anew."""

NARROW = 1e-12
"""Bounds this close hold a jump: no argument between them makes the function zero [mm]."""

MOST_MM = 10.0
"""How far from its first guess an argument is looked for: the largest error that any machine has [mm]."""

ANEW = 3


class RootSearch:
    """Looks for x_i with f_i(x) = 0, where f_i hangs on x_i and hardly on the others, and falls with it in the large.

    Bounds to either side of each zero are found first, by steps that double, and then narrowed. Where the others move f_i, bounds that have become wrong are looked for anew. Where f_i
    jumps over zero the side with the smaller value is taken.

    Args:
        guess: where to begin, shape (k,).
        met: |f| that counts as zero.

    Attributes:
        at: where f is wanted next; where `done`, the answer, shape (k,).
        lost: number, from 1, of the first function that has no zero near the guess; 0 where all have.
    """

    def __init__(self, guess: NDArray[np.float64], met: float) -> None:
        self.at, self.done, self.lost = guess.copy(), False, 0
        self._guess, self._met = guess, met
        self._steps = self._anew = 0
        nothing = np.full(len(guess), np.nan)
        self._low, self._low_value, self._high, self._high_value, self._step = (nothing.copy() for _ in range(5))

    def tell(self, value: NDArray[np.float64]) -> None:
        """Take f at `at`, shape (k,), and say where it is wanted next."""
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

    def _between(self, width: NDArray[np.float64]) -> NDArray[np.float64]:
        """By turns the middle, as far from either bound as f is there, and false position.

        The second is right at once where f falls as its argument rises, as behind a play.
        """
        middle = self._low + 0.5 * width
        with np.errstate(invalid="ignore", divide="ignore"):
            false = self._low + width * self._low_value / (self._low_value - self._high_value)
        turn = (middle, self._high + self._high_value, self._low + self._low_value, false)[self._steps % 4]
        return np.where((turn > self._low) & (turn < self._high), turn, middle)
