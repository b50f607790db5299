"""Unmodelled effects as causes: errors that follow some variable and have no named cause, compared beside the named ones."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit.calibrate import SMALLEST_NOISE_MM
from dbbstation.diagnosis.shape_look import TemplateScan, looked_for
from dbbstation.diagnosis.shapes import PLAUSIBLE_MM, Samples, Shape, ranges, samples_of, shapes
from dbbstation.inference.blocks import with_random
from dbbstation.inference.model_comparison import Cause, Variant
from dbbstation.machine.geometry import STRUTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.diagnosis.channel import CircleChannel
    from dbbstation.inference.model_comparison import Member

FAMILY_ODDS = float(np.log(0.1 / 0.9))
"""Log prior odds that something without a name is at work: one machine in ten. All kinds of curves share them, and so do the
struts, and the frequencies or places that a kind was picked from."""


@dataclass(eq=False)
class Unmodelled:
    """Unmodelled effects over a channel; they may become more.

    Attributes:
        runs: as shapes see them.
        shapes: by the name of the cause.
        causes: with their columns in the channel.
    """

    channel: CircleChannel
    runs: list[Samples] = field(init=False)
    shapes: dict[str, Shape] = field(default_factory=dict)
    causes: list[Cause] = field(default_factory=list)

    def __post_init__(self) -> None:
        channel = self.channel
        pivot = np.mean([observation.setup.fixed_ball_mm for observation in channel.observations], axis=0)
        self.runs = [
            samples_of(motion, channel.machine, reading, pivot)
            for motion, reading in zip(channel.motions, channel.readings, strict=True)
        ]
        self._add(shapes(ranges(self.runs)))

    def look(self, fit: Calibration, members: Sequence[Member], noise_mm: float) -> None:
        """Look for waves, bumps, steps and pulses in what a fit leaves, beside its base and causes, and take them in.

        Args:
            fit: the base fit or a joint one.
            members: causes that it has, or that stand beside it.
            noise_mm: of one sample [mm].
        """
        channel = self.channel
        taken = np.concatenate([np.zeros(0, dtype=np.int64), *(member.columns for member in members)])
        known = with_random(channel.base, np.concatenate([np.zeros(0), *(member.sd for member in members)]))
        own = channel.columns
        base = (np.hstack([own.base[rows], own.samples[rows][:, taken]]) for rows in channel.runs)
        noise_mm = max(noise_mm, SMALLEST_NOISE_MM)
        look = TemplateScan(self.runs, list(fit.residual_mm), base, known, channel.held, noise_mm)
        self._add(looked_for(look, ranges(self.runs)))

    def _add(self, more: Sequence[Shape]) -> None:
        """Take in shapes: columns of the channel, and prior odds shared by all kinds, struts and forms tried."""
        more = [shape for shape in more if _name(shape) not in self.shapes]
        if not more:
            return
        pieces = [np.hstack([shape.columns(run) for shape in more]) for run in self.runs]
        columns = self.channel.columns.add(np.vstack(pieces))
        self.shapes |= {_name(shape): shape for shape in more}
        first = 0
        for shape in more:
            size = shape.columns(self.runs[0]).shape[1]
            variant = Variant(columns[first : first + size], np.full(size, PLAUSIBLE_MM))
            struts = STRUTS + 1 if shape.strut is not None else 1
            odds = FAMILY_ODDS - float(np.log(KINDS * struts * shape.tried))
            self.causes.append(Cause(_name(shape), (variant,), odds, named=False))
            first += size


KINDS = 30
"""Combinations of variable, kind of curve and what moves, about."""


def _name(shape: Shape) -> str:
    """Unique name of an unmodelled effect."""
    where = f"strut {shape.strut}" if shape.strut else "no single strut"
    return f"unmodelled: {shape.follows}, {where}, {shape.form.text('')}"
