"""What the figures of a circle cost by its number of samples, and its noise beside the same sums made from a basis.

Processor time of this process, the best of three: a machine with other work to do gives the same figures.

    python benchmarks/circles.py
    python benchmarks/circles.py --json
"""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING

from benchmarks.measuring import Row, show  # isort: skip - sets up the environment

import numpy as np

from dbbstation.circles.analysis import analyse
from dbbstation.circles.quick_look import quick_look
from dbbstation.inference.harmonics import HIGH, LOW, basis, coefficients, smooth
from dbbstation.plan.plan import Circle, Direction
from dbbstation.trace.recording import RawCircle

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

CIRCLE = Circle((0, 0, 0), (0, 0, 0), 150.0, (0, 0, 0), 1000.0, 0.0, 45.0, 1.5, 0.0, Direction.CCW)
SAMPLES = (2_800, 56_500)
"""Of a turn at 50 Hz and at 1 kHz, 150 mm and 1000 mm/min."""


def measured(samples: int) -> RawCircle:
    """Make an ellipse of 20 µm with noise of 0.2 µm, seed 1."""
    phi = np.arange(samples) * 360.0 / samples
    form = 0.01 * np.cos(2.0 * np.radians(phi)) + np.random.default_rng(1).normal(0.0, 2e-4, samples)
    return RawCircle("a run", CIRCLE, phi / CIRCLE.turning_deg_s, phi, CIRCLE.bar_mm + form)


def best_ms(work: Callable[[], object]) -> float:
    """Return the least processor time of three [ms]."""
    times = []
    for _ in range(3):
        begun = time.process_time()
        work()
        times.append(time.process_time() - begun)
    return 1e3 * min(times)


def sums_by_basis(values: NDArray[np.float64], phase_rad: NDArray[np.float64]) -> object:
    """Peer of the spectrum: every harmonic of every sample written out."""
    return basis(phase_rad, HIGH).T @ values


def fit_by_basis(values: NDArray[np.float64], phase_rad: NDArray[np.float64]) -> object:
    """Peer of the low-pass: least squares of the same."""
    return np.linalg.lstsq(basis(phase_rad, LOW), values, rcond=None)


def run() -> list[Row]:
    """Time each part."""
    rows: list[Row] = []
    for samples in SAMPLES:
        raw = measured(samples)
        one = analyse(raw)
        phase, left = np.radians(raw.phi_deg), one.residual_um
        columns = f"{samples} samples"
        parts: list[tuple[str, Callable[[], object], str]] = [
            ("all figures of a circle", partial(analyse, raw), ""),
            ("quick look", partial(quick_look, [one]), "one direction"),
            ("spectrum", partial(coefficients, left, phase, HIGH), f"{HIGH} harmonics"),
            ("  by a basis", partial(sums_by_basis, left, phase), "peer"),
            ("low-pass", partial(smooth, left, phase), f"{LOW} harmonics"),
            ("  by a basis", partial(fit_by_basis, left, phase), "peer"),
        ]
        rows += [Row(f"{columns}: {what}", best_ms(work), "ms", remark) for what, work, remark in parts]
    return rows


if __name__ == "__main__":
    show("figures of circles", run(), "processor time, best of 3")
