"""Unmodelled effects as causes, in addition to named ones."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit.calibrate import SMALLEST_NOISE_MM
from dbbstation.diagnosis.parts import ALIKE
from dbbstation.diagnosis.shape_look import TemplateScan, looked_for
from dbbstation.diagnosis.shapes import PLAUSIBLE_MM, Follows, Samples, Shape, ranges, samples_of, shapes, wander
from dbbstation.inference.blocks import with_random
from dbbstation.inference.model_comparison import Cause, Variant, all_columns
from dbbstation.inference.patterns import FAMILY_ODDS
from dbbstation.machine.geometry import STRUTS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Integers
    from dbbstation.diagnosis.channel import CircleChannel
    from dbbstation.inference.model_comparison import Member


@dataclass(eq=False)
class Unmodelled:
    """A channel's unmodelled effects, extensible.

    Attributes:
        shapes: by cause and form; per strut if each has its own.
    """

    channel: CircleChannel
    runs: list[Samples] = field(init=False)
    follows: dict[str, Follows] = field(default_factory=dict)
    shapes: dict[tuple[str, str], tuple[Shape, ...]] = field(default_factory=dict)
    causes: list[Cause] = field(default_factory=list)
    _looked_for: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        channel = self.channel
        pivot = np.mean([observation.setup.fixed_ball_mm for observation in channel.observations], axis=0)
        self.runs = [
            samples_of(motion, channel.machine, reading, pivot)
            for motion, reading in zip(channel.motions, channel.readings, strict=True)
        ]
        self._add([*shapes(ranges(self.runs)), *wander(self.runs)])

    def look(self, fit: Calibration, best: Sequence[Member], noise_mm: float) -> None:
        """Search the residual of base and named causes for waves, bumps, steps and pulses, and add them.

        Effects of earlier searches outside the best set are dropped first.
        """
        members = [member for member in best if member.cause.named]
        channel = self.channel
        known = with_random(channel.base, [member.sd for member in members])
        own = channel.columns
        base = (np.hstack([own.base[rows], own.samples[rows][:, all_columns(members)]]) for rows in channel.runs)
        noise_mm = max(noise_mm, SMALLEST_NOISE_MM)
        # The scan has a copy of the base, which no effect that is added needs.
        found = looked_for(
            TemplateScan(self.runs, list(fit.residual_mm), base, known, channel.held, noise_mm), ranges(self.runs)
        )
        self._forget(self._looked_for - {member.name for member in best})
        before = set(self.follows)
        self._add(found)
        self._looked_for |= set(self.follows) - before

    def of(self, member: Member) -> tuple[Shape, ...]:
        """Return shapes of an effect's form; empty for named causes."""
        return self.shapes.get((member.name, member.variant.label), ())

    def _forget(self, names: set[str]) -> None:
        gone = [variant for cause in self.causes if cause.name in names for variant in cause.variants]
        self.channel.columns.give_back(np.unique(all_columns(gone)))
        self.causes = [cause for cause in self.causes if cause.name not in names]
        self.follows = {name: follows for name, follows in self.follows.items() if name not in names}
        self._looked_for -= names

    def _add(self, more: Sequence[Shape]) -> None:
        families: dict[str, list[Shape]] = {}
        for shape in more:
            families.setdefault(_name(shape), []).append(shape)
        families = {name: family for name, family in families.items() if name not in self.follows}
        more = [shape for family in families.values() for shape in family]
        if not more:
            return
        samples = np.empty((self.channel.runs[-1].stop, sum(shape.columns(self.runs[0]).shape[1] for shape in more)))
        for rows, run in zip(self.channel.runs, self.runs, strict=True):
            np.concatenate([shape.columns(run) for shape in more], axis=1, out=samples[rows])
        columns = self.channel.columns.add(samples)
        for name, family in families.items():
            counts = np.cumsum([shape.columns(self.runs[0]).shape[1] for shape in family])
            own, columns = np.split(columns[: counts[-1]], counts[:-1]), columns[counts[-1] :]
            odds = FAMILY_ODDS - float(np.log(KINDS * family[0].tried))
            self.follows[name] = family[0].follows
            self.causes.append(Cause(name, tuple(self._variants(name, family, own)), odds, named=False))

    def _variants(self, name: str, family: Sequence[Shape], columns: Sequence[Integers]) -> Iterator[Variant]:
        forms: list[tuple[tuple[Shape, ...], Integers]] = [
            ((shape,), own) for shape, own in zip(family, columns, strict=True)
        ]
        single = [form for form in forms if form[0][0].strut is not None]
        if len(single) == STRUTS:
            forms.append((tuple(some[0] for some, _ in single), np.concatenate([own for _, own in single])))
        kinds = [[form for form in forms if _label(form[0]).startswith(kind)] for kind in ("strut", ALIKE, EACH)]
        kinds = [kind for kind in kinds if kind]
        for kind in kinds:
            for some, own in kind:
                self.shapes[name, _label(some)] = some
                weight = -float(np.log(len(kinds) * len(kind)))
                yield Variant(own, np.full(len(own), PLAUSIBLE_MM), label=_label(some), log_weight=weight)


EACH = "each strut its own"
"""Label of the form with a separate curve for each strut."""

KINDS = 30
"""Approximate number of combinations of variable, kind of curve and moved part."""


def _label(shapes: Sequence[Shape]) -> str:
    if len(shapes) > 1:
        return EACH
    return f"strut {shapes[0].strut}" if shapes[0].strut else ALIKE


def _name(shape: Shape) -> str:
    """Return the name of a shape's cause; bumps and steps belong to one strut."""
    own = f", strut {shape.strut}" if shape.strut and shape.kind in {"bump", "step"} else ""
    text = shape.form.text("")
    return f"unmodelled: {shape.follows}{own}{', ' + text if text else ''}"
