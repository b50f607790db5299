"""Detect a ringing strut: the residual grows after its reversals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import fdtrc

from dbbstation.inference.triangle import root
from dbbstation.machine.geometry import STRUT_NUMBERS, STRUTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.diagnosis.shapes import Samples


FEWEST = 8
"""Fewest stretches of each kind for a comparison of mean squares."""


@dataclass(frozen=True)
class Louder:
    """Mean squares in some stretches, compared with other stretches."""

    probability: float
    rms: float
    elsewhere: float

    @property
    def beyond(self) -> float:
        """Return the stretches' excess rms, in the residual's unit."""
        return root(self.rms**2 - self.elsewhere**2)


def louder(residuals: Sequence[Floats], begins: Sequence[Integers], length: int) -> Louder | None:
    """Compare the stretches that begin at given rows with other stretches of equal length; None for too few.

    Correlated mean squares have 2 mean² / variance degrees of freedom [Satterthwaite, Biometrics Bulletin 2 (1946) 110].

    Args:
        begins: first rows of stretches per run, unordered.
    """
    inside, outside = [], []
    for residual, rows in zip(residuals, begins, strict=True):
        squares, taken = residual**2, np.zeros(len(residual), dtype=bool)
        for row in rows.tolist():
            own = slice(row, row + length)
            # A stretch that overlaps the previous one is not counted.
            if row + length <= len(residual) and not taken[own].any():
                inside.append(float(squares[own].mean()))
            taken[own] = True
        starts = range(0, len(residual) - length + 1, length)
        outside += [float(squares[k : k + length].mean()) for k in starts if not taken[k : k + length].any()]
    if min(len(inside), len(outside)) < FEWEST:
        return None
    there, elsewhere = float(np.mean(inside)), float(np.mean(outside))
    spread = float(np.var(outside, ddof=1))
    if not (elsewhere > 0.0 and spread > 0.0):
        return None
    each = 2.0 * elsewhere**2 / spread
    chance = float(fdtrc(each * len(inside), each * len(outside), there / elsewhere))
    return Louder(chance, float(np.sqrt(there)), float(np.sqrt(elsewhere)))


WITHIN_S = (0.5, 1.0, 2.0, 4.0)
"""Tested times after a reversal [s]: usual durations of oscillations of a drive's control or mounting."""

FEWEST_ROWS = 4
"""Fewest samples of such a stretch: two samples cannot distinguish an oscillation from noise."""


@dataclass(frozen=True)
class AfterReversals:
    """The residual after one strut's reversals.

    Attributes:
        strut: 1 to 6.
        probability: under uniform noise, over all struts and times.
    """

    strut: int
    within_s: float
    probability: float
    rms_um: float
    elsewhere_um: float
    beyond_um: float

    @property
    def text(self) -> str:
        """Return the finding in two sentences."""
        return (
            f"The residual is larger just after strut {self.strut} turns round: {self.rms_um:.2g} µm rms within {self.within_s:g} s, "
            f"{self.elsewhere_um:.2g} µm elsewhere. A strut that rings does that; noise that is the same everywhere does not."
        )


def after_reversals(runs: Sequence[Samples], residual_mm: Sequence[Floats]) -> AfterReversals | None:
    """Return the strut with the largest residual after reversals; None for too few samples."""
    if not all({"time", "strut-speed-sign"} <= run.values.keys() for run in runs):
        return None
    apart_s = float(np.median(np.concatenate([np.diff(run.values["time"]) for run in runs])))
    found: list[AfterReversals] = []
    lengths = [(within_s, round(within_s / apart_s)) for within_s in WITHIN_S]
    lengths = [(within_s, rows) for within_s, rows in lengths if rows >= FEWEST_ROWS]
    for strut in STRUT_NUMBERS:
        begins = [_reversals(run.values["strut-speed-sign"][:, strut - 1]) for run in runs]
        for within_s, rows in lengths:
            one = louder(residual_mm, begins, rows)
            if one is not None:
                chance = min(1.0, one.probability * STRUTS * len(lengths))
                sizes_um = 1e3 * one.rms, 1e3 * one.elsewhere, 1e3 * one.beyond
                found.append(AfterReversals(strut, within_s, chance, *sizes_um))
    return min(found, key=lambda one: (one.probability, -one.beyond_um), default=None)


def _reversals(sign: Floats) -> Integers:
    moving = np.flatnonzero(sign)
    return moving[1:][np.diff(sign[moving]) != 0.0]
