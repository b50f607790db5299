"""The race of errors without a name, on what a fit leaves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit import SMALLEST_NOISE_MM
from dbbstation.diagnosis.channel import base_columns
from dbbstation.diagnosis.shape_look import Look, looked_for
from dbbstation.diagnosis.shapes import PLAUSIBLE_MM, Samples, Shape, ranges, samples_of, shapes
from dbbstation.inference.race import Race, Variant, race_on, together
from dbbstation.inference.square_root import Block, compress, joined

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.calibration.fit import Calibration
    from dbbstation.inference.square_root import Columns

SIZES = (1.0, 0.3, 0.1, 0.03, 0.01)
"""Sizes that shapes are looked for at, in units of the usual one: what is just seen is a hundredth of a micrometre."""


@dataclass(frozen=True, eq=False)
class Best:
    """The shape that describes best what a fit leaves.

    Attributes:
        shape: what follows what.
        variant: its columns, at the size that suits best.
        gain: log evidence, what picking it from many forms costs taken off.
    """

    shape: Shape
    variant: Variant
    gain: float


@dataclass(frozen=True, eq=False)
class Unnamed:
    """All shapes about one fit.

    Attributes:
        race: of them, the columns of the fit eliminated.
        shapes: with their columns at the usual size.
        block: all runs: columns of the fit, then of the shapes.
        base: what is known of the columns of the fit.
        held: directions that the fit keeps at nominal.
        runs: as shapes see them.
    """

    race: Race
    shapes: tuple[tuple[Shape, Variant], ...]
    block: Block
    base: Columns
    held: NDArray[np.float64]
    runs: tuple[Samples, ...]

    def best(self) -> Best:
        """Return the shape of the greatest evidence."""
        return max(self.each, key=lambda best: best.gain)

    @cached_property
    def each(self) -> tuple[Best, ...]:
        """All shapes, each at its best size.

        One that was picked from many forms shares its chance with all of them, and all sizes are as likely.
        """
        found = []
        for shape, usual in self.shapes:
            gains = self.race.gains(usual, SIZES)
            gain = together(gains) - float(np.log(shape.tried))
            found.append(Best(shape, usual.scaled(SIZES[int(gains.argmax())]), gain))
        return tuple(found)


def unnamed(calibration: Calibration, noise_mm: float, only: Sequence[Shape] | None = None) -> Unnamed:
    """Lay out shapes over the runs of a fit.

    Args:
        calibration: the fit; its runs as thinned.
        noise_mm: of one sample [mm].
        only: these shapes; all that there are, and those that the readings follow best, if None.
    """
    layout, noise = calibration.layout, max(noise_mm, SMALLEST_NOISE_MM)
    count = len(layout.known.prior)
    runs, numbers, jacobians, left = [], [], [], []
    pivot = np.mean([observation.setup.fixed_ball_mm for observation in calibration.observations], axis=0)
    for observation in calibration.observations:
        motion = observation.motion()
        reading = calibration.model.bar(motion)
        runs.append(samples_of(motion, layout.machine, reading, pivot))
        own, jacobian = base_columns(calibration, motion, reading)
        numbers.append(own)
        jacobians.append(jacobian)
        left.append(observation.raw.length_mm - reading.length_mm)
    held = calibration.solution.held
    extent = ranges(runs)
    wide = [_widened(own, jacobian, count) for own, jacobian in zip(numbers, jacobians, strict=True)]
    every = list(only or ())
    if only is None:
        every = [*shapes(extent), *looked_for(Look(runs, left, wide, layout.known, held, noise), extent)]
    blocks = [
        _block(run, every, own, jacobian, residual, (calibration.x - layout.nominal)[own], count)
        for run, own, jacobian, residual in zip(runs, numbers, jacobians, left, strict=True)
    ]
    variants, total = [], count
    for shape, size in zip(every, _sizes(every, runs[0]), strict=True):
        variants.append((shape, Variant(np.arange(total, total + size), np.full(size, PLAUSIBLE_MM))))
        total += size
    block = joined(blocks, total)
    race = race_on([block], layout.known, held, total, noise)
    return Unnamed(race, tuple(variants), block, layout.known, held, tuple(runs))


def _widened(numbers: NDArray[np.int64], jacobian: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    wide = np.zeros((len(jacobian), count))
    wide[:, numbers] = jacobian
    return wide


def _sizes(every: Sequence[Shape], run: Samples) -> list[int]:
    """Number of columns of each shape."""
    return [shape.columns(run).shape[1] for shape in every]


def _block(
    run: Samples,
    every: Sequence[Shape],
    numbers: NDArray[np.int64],
    jacobian: NDArray[np.float64],
    residual: NDArray[np.float64],
    x: NDArray[np.float64],
    count: int,
) -> Block:
    """One run: columns of the fit, then of all shapes; target about nominal values."""
    columns = np.hstack([shape.columns(run) for shape in every])
    own = np.concatenate([numbers, count + np.arange(columns.shape[1])])
    return compress(own, np.hstack([jacobian, columns]), residual + jacobian @ x)
