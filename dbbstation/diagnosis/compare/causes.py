"""Error sources that changed, or act in one session only, as causes of a difference."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.discrepancy import Effects, discrepancy_of, left_open_of
from dbbstation.diagnosis.parts import ALIKE, amplitudes, at_point, by_amplitudes, parts_of, variable_of
from dbbstation.diagnosis.shapes import variables
from dbbstation.inference.alternatives import EQUIVALENT
from dbbstation.inference.channel import Law
from dbbstation.sources.contract import Effect, LinearSource, Need

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.diagnosis.compare.sides import Sides
    from dbbstation.sources.contract import ErrorSource, Parameter

HARDLY_DIFFERENT = sqrt(1.0 - EQUIVALENT**2)
"""Relative difference of an effect between both sessions, below which an effect in B equals the missing effect of A:
the sine of the angle with cosine `EQUIVALENT`, 4.5 %."""


@dataclass(frozen=True)
class When:
    """A combination of sessions in which a source acts; differences are B minus A.

    Attributes:
        label: empty for a change common to both.
    """

    label: str
    of_a: float
    of_b: float


CHANGED, IN_A, IN_BOTH = When("", 0.0, 1.0), When("in A", -1.0, 0.0), When("in both alike", -1.0, 1.0)
IN_B = When("in B", 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Change:
    """One error source in both sessions."""

    source: ErrorSource
    sides: Sides
    share: float = 1.0

    def _name(self) -> str:
        usual = self.source.law == self.source.varies_with != "temperature"
        return self.source.name if usual else f"{self.source.name} by {self.source.law}"

    def law(self, log_odds: float) -> Law:
        """Return the source as a law, with forms by part and combination."""
        amplitudes, shapes = self._amplitudes, [p for p in self._parameters if p.grid]
        parts = parts_of(amplitudes, self._sets)
        count = len(amplitudes) * self._sets
        choices: list[tuple[tuple[int, ...], float, str]] = []
        names: list[str] = []
        units: list[str] = []
        plausible: list[float] = []
        for when in self._whens:
            first = len(plausible)
            behind = f", {when.label}" if when.label else ""
            for k in range(count):
                parameter = amplitudes[k % len(amplitudes)]
                number = f" ({k // len(amplitudes) + 1})" if self._sets > 1 else ""
                names.append(f"{parameter.name}{number}{behind}")
                units.append(parameter.unit)
                plausible.append(self.share * parameter.plausible)
            if self._alike:
                names.append(f"{ALIKE}{behind}")
                units.append(amplitudes[0].unit)
                plausible.append(self.share * amplitudes[0].plausible)
            for part in parts:
                own = (first + count,) if part.alike else tuple(first + k for k in part.amplitudes)
                label = " ".join(text for text in (part.label, when.label) if text)
                choices.append((own, part.log_weight - float(np.log(len(self._whens))), label))
        return Law(
            name=self._name(),
            columns=self.columns,
            plausible=np.array(plausible),
            parameters=(*names, *(p.name for p in shapes)),
            units=(*units, *(p.unit for p in shapes)),
            grids=tuple(self._grid(k, p) for k, p in enumerate(shapes)),
            form_uncertainty=self.source.form_uncertainty,
            discrepancy=self._discrepancy,
            log_odds=log_odds,
            at=None if self._proportional else self._at,
            choices=tuple(choices),
            followed=(variable_of(self.source),),
            way="direction" if self.source.varies_with.endswith("sign") else "",
            confirm=self.source.texts.confirm,
        )

    def columns(self, point: tuple[float, ...]) -> Floats:
        """Return derivatives of readings B minus A by amplitudes, for each combination, shape (n, p)."""
        of_a = self._of(0, point) if len(self._whens) > 1 else None
        of_b = self._of(1, point)
        found = []
        for when in self._whens:
            own = when.of_b * of_b
            if of_a is not None and when.of_a:
                own = own + when.of_a * of_a
            found += [own, own.sum(axis=1, keepdims=True)] if self._alike else [own]
        return np.hstack(found)

    def _at(self, point: tuple[float, ...], amplitudes: Floats) -> Floats:
        found = self.columns(point)
        width = len(amplitudes) // len(self._whens)
        for k in np.flatnonzero(amplitudes).tolist():
            when, own = self._whens[k // width], k % width
            values = np.zeros(len(self._amplitudes) * self._sets)
            values[slice(None) if self._alike and own == width - 1 else own] = amplitudes[k]
            effect = when.of_b * self._effect(1, point, values)
            if when.of_a:
                effect = effect + when.of_a * self._effect(0, point, values)
            found[:, k] = effect / amplitudes[k]
        return found

    def _effect(self, side: int, point: tuple[float, ...], amplitudes: Floats) -> Floats:
        pieces, sides = [], self.sides
        for group, motion, reading in zip(self._groups, sides.motions[side], sides.readings[side], strict=True):
            values = self._values(point, amplitudes, group)
            effect = self.source.effect(motion, sides.machine, values)
            pieces.append(reading.by_parameters(_as_derivative(effect))[:, 0])
        return sides.averaged(side, pieces)

    @property
    def _proportional(self) -> bool:
        return isinstance(self.source, LinearSource) or Need.PATH not in self.source.needs

    def _values(self, point: tuple[float, ...], sizes: Floats, group: int) -> Floats:
        own = np.split(sizes, self._sets)[group]
        return at_point(self.source, self.sides.machine, point, own)

    @cached_property
    def _parameters(self) -> tuple[Parameter, ...]:
        return self.source.parameters(self.sides.machine)

    @cached_property
    def _amplitudes(self) -> list[Parameter]:
        return amplitudes(self.source, self.sides.machine)

    @cached_property
    def _middle(self) -> tuple[float, ...]:
        return tuple(p.grid[len(p.grid) // 2] for p in self._parameters if p.grid)

    @cached_property
    def _groups(self) -> Integers:
        return self.sides.groups(self.source)

    @property
    def _sets(self) -> int:
        return int(self._groups.max()) + 1

    @cached_property
    def _alike(self) -> bool:
        return any(part.alike for part in parts_of(self._amplitudes, self._sets))

    @cached_property
    def _whens(self) -> tuple[When, ...]:
        of_a, of_b = self._of(0, self._middle), self._of(1, self._middle)
        size = max(float(np.linalg.norm(of_a)), float(np.linalg.norm(of_b)), 1e-300)
        apart = float(np.linalg.norm(of_b - of_a)) / size
        return (CHANGED,) if apart <= HARDLY_DIFFERENT else (IN_B, IN_A, IN_BOTH)

    def _grid(self, k: int, parameter: Parameter) -> tuple[float, ...]:
        middle, values = self._middle, tuple(sorted(parameter.grid))
        shown = tuple(v for v in values if self.source.shows(self.sides.motions[1], [*middle[:k], v, *middle[k + 1 :]]))
        return shown or values[:1]

    def _of(self, side: int, point: tuple[float, ...]) -> Floats:
        count, pieces = len(self._amplitudes), []
        for group, reading in zip(self._groups, self.sides.readings[side], strict=True):
            derivative = by_amplitudes(reading, self.source, self.sides.machine, point)
            own = np.zeros((len(derivative), count * self._sets))
            own[:, count * group : count * (group + 1)] = derivative
            pieces.append(own)
        return self.sides.averaged(side, pieces)

    def _discrepancy(self, effect: Floats, point: tuple[float, ...], amplitudes: Floats) -> Floats:
        count = len(self._amplitudes) * self._sets
        total = [np.zeros(count), np.zeros(count)]
        for when, own in zip(self._whens, np.split(amplitudes, len(self._whens)), strict=True):
            values = own[:count] + (own[count] if self._alike else 0.0)
            total[0] += when.of_a * values
            total[1] += when.of_b * values
        found = [np.zeros((len(effect), 0))]
        found += [self._slack(side, point, values) for side, values in enumerate(total) if values.any()]
        return np.hstack(found)

    def _slack(self, side: int, point: tuple[float, ...], amplitudes: Floats) -> Floats:
        runs, sides = [], self.sides
        for group, motion, reading in zip(self._groups, sides.motions[side], sides.readings[side], strict=True):
            values = self._values(point, amplitudes, group)
            derivative = reading.by_source(self.source, sides.machine, values)
            runs.append(Effects(motion, reading, values, derivative, variables(motion, sides.machine)))
        found = np.hstack([of(self.source, sides.machine, runs) for of in (discrepancy_of, left_open_of)])
        return sides.averaged(side, np.split(found, np.cumsum([len(run.derivative) for run in runs])[:-1]))


def _as_derivative(effect: Effect) -> Effect:
    arrays = {field.name: getattr(effect, field.name) for field in fields(effect)}
    return Effect(**{name: None if array is None else np.asarray(array)[..., None] for name, array in arrays.items()})
