"""An unmodelled effect's curve with a band of two standard uncertainties."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.shapes import EVERY, PULL, SIGNED, TOWARDS
from dbbstation.report.drawing import AFTER

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.findings import Curve

PER_WAVE = 24
"""Points that a wave is drawn with."""

SENSES = {-1.0: "shortening", 1.0: "lengthening"}


def draw_unexplained(part: SubFigure, curve: Curve) -> None:
    """Draw one curve; signs of travel are two points with bars."""
    axes: Axes = part.subplots()
    at, value, sigma = _between(curve)
    if curve.unit == "sign":
        axes.errorbar(at, value, 2.0 * sigma, color=AFTER, marker="o", markersize=4.0, linewidth=0.0, elinewidth=1.2)
        axes.set_xticks(list(SENSES), [*SENSES.values()])
        axes.set_xlim(-2.0, 2.0)
        axes.set_xlabel("sense of travel")
    else:
        axes.fill_between(at, value - 2.0 * sigma, value + 2.0 * sigma, color=AFTER, alpha=0.3, linewidth=0.0)
        axes.plot(at, value, color=AFTER, linewidth=1.0)
        axes.set_xlim(at[0], at[-1])
        axes.set_xlabel(f"{curve.follows.variable.replace('-', ' ')}, {'°' if curve.unit == 'deg' else curve.unit}")
    axes.axhline(0.0, color="black", linewidth=0.5, linestyle=":")
    axes.set_ylabel("µm, ±2u")
    axes.set_title(curve.convention, loc="right")
    part.suptitle(f"without a name: {_whose(curve)}, cause unknown", fontsize=9, x=0.01, ha="left")


def _whose(curve: Curve) -> str:
    wave = "" if curve.period_mm is None else f"a wave of {curve.period_mm:.2f} mm: "
    if curve.strut is not None:
        return f"{wave}error of strut {curve.strut}"
    return f"{wave}error of {WHOSE.get(curve.follows.moves, f'the {curve.follows.moves}')}"


WHOSE = {EVERY: EVERY, SIGNED: EVERY, PULL: "every strut by a pull", TOWARDS: "every strut by a pull towards a place"}
"""What moves, as a title says it; bodies have their own names."""


def _between(curve: Curve) -> tuple[Floats, ...]:
    """Return places, values and uncertainties, shape (n,) each, interpolated for waves [µm]."""
    at, value, sigma = np.array([(p.at, p.value_um, p.uncertainty_um) for p in curve.points]).T
    if curve.period_mm is None or len(at) < 3:  # noqa: PLR2004 (amplitudes need as many points)
        return at, value, sigma
    # A wave is one of cosine and sine; its variance is one of twice the angle beside a constant.
    fine = np.linspace(at[0], at[-1], 1 + int(np.ceil(PER_WAVE * (at[-1] - at[0]) / curve.period_mm)))
    turn = 2.0 * np.pi / curve.period_mm
    wave = _cosine_and_sine(turn * fine) @ np.linalg.lstsq(_cosine_and_sine(turn * at), value, rcond=None)[0]
    given, wanted = (np.column_stack([np.ones(len(x)), _cosine_and_sine(2.0 * turn * x)]) for x in (at, fine))
    variance = wanted @ np.linalg.lstsq(given, sigma**2, rcond=None)[0]
    return fine, wave, np.sqrt(np.maximum(variance, 0.0))


def _cosine_and_sine(angle_rad: Floats) -> Floats:
    return np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])
