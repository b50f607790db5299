"""Two sessions as a channel: readings of A simulate B for each circle, and error sources changed or act in one only."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit.calibrate import KINEMATIC_SOURCES, MEASUREMENT_SOURCES
from dbbstation.diagnosis.compare.set_up import base_of, jig_laws, set_up_laws
from dbbstation.diagnosis.parts import ALIKE, SourceOverRuns, at_point, variable_of
from dbbstation.diagnosis.shapes import EVERY, READING, SIGNED, UNITS, ranges, samples_of, shapes
from dbbstation.inference.alternatives import EQUIVALENT
from dbbstation.inference.channel import NAMED_ODDS, Channel, Kind, Law, Variable
from dbbstation.inference.forms import LinearSplines, Lobes, SignForm
from dbbstation.inference.patterns import Family, Pattern, patterns
from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import Effect, LinearSource, Need
from dbbstation.sources.registry import sources_named

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.compare.pairs import Sides
    from dbbstation.diagnosis.shapes import Samples, Shape
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

    @cached_property
    def _over(self) -> list[SourceOverRuns]:
        """Return the source over the runs of A and B, which share its values if both sessions' runs do."""
        sides, source = self.sides, self.source
        shared = [(source.shared_by(one), source.shared_by(other)) for one, other in zip(*sides.motions, strict=True)]
        every = zip(sides.motions, sides.readings, sides.variables, strict=True)
        return [SourceOverRuns(source, sides.machine, m, r, shared, known) for m, r, known in every]

    def _name(self) -> str:
        usual = self.source.law == self.source.varies_with != "temperature"
        return self.source.name if usual else f"{self.source.name} by {self.source.law}"

    def law(self, log_odds: float) -> Law:
        """Return the source as a law, with forms by part and combination."""
        over, whens = self._over[1], self._whens
        shapes, sets, count = over.shapes, over.sets, len(over.amplitudes)
        named = [f"{p.name} ({k // count + 1})" if sets > 1 else p.name for k, p in enumerate(over.amplitudes * sets)]
        own = list(zip(over.every, [*named, ALIKE], strict=False))
        every = [(p, f"{name}, {when.label}" if when.label else name) for when in whens for p, name in own]
        choices = tuple(
            (
                tuple(number * len(own) + place for place in places),
                weight - float(np.log(len(whens))),
                " ".join(text for text in (label, when.label) if text),
            )
            for number, when in enumerate(whens)
            for places, weight, label in over.forms
        )
        return Law(
            name=self._name(),
            columns=self.columns,
            plausible=np.array([self.share * p.plausible for p, _ in every]),
            parameters=(*(name for _, name in every), *(p.name for p in shapes)),
            units=(*(p.unit for p, _ in every), *(p.unit for p in shapes)),
            grids=tuple(self._grid(k, p) for k, p in enumerate(shapes)),
            form_uncertainty=self.source.form_uncertainty,
            discrepancy=self._discrepancy,
            log_odds=log_odds,
            at=None if self._proportional else self._at,
            choices=choices,
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
            found += [own, own.sum(axis=1, keepdims=True)] if self._over[1].alike else [own]
        return np.hstack(found)

    def _at(self, point: tuple[float, ...], amplitudes: Floats) -> Floats:
        found = self.columns(point)
        width, over = len(amplitudes) // len(self._whens), self._over[1]
        for k in np.flatnonzero(amplitudes).tolist():
            when, own = self._whens[k // width], k % width
            values = np.zeros(len(over.amplitudes) * over.sets)
            values[slice(None) if over.alike and own == width - 1 else own] = amplitudes[k]
            effect = when.of_b * self._effect(1, point, values)
            if when.of_a:
                effect = effect + when.of_a * self._effect(0, point, values)
            found[:, k] = effect / amplitudes[k]
        return found

    def _effect(self, side: int, point: tuple[float, ...], amplitudes: Floats) -> Floats:
        pieces, over = [], self._over[side]
        for motion, reading, values in zip(over.motions, over.readings, self._values(point, amplitudes), strict=True):
            effect = self.source.effect(motion, over.machine, values)
            pieces.append(reading.by_parameters(_as_derivative(effect))[:, 0])
        return self.sides.averaged(side, pieces)

    @property
    def _proportional(self) -> bool:
        return isinstance(self.source, LinearSource) or Need.PATH not in self.source.needs

    def _values(self, point: tuple[float, ...], sizes: Floats) -> list[Floats]:
        """Return the source's values in each run, shape (p,)."""
        over = self._over[1]
        of_groups = np.split(sizes, over.sets)
        return [at_point(self.source, over.machine, point, of_groups[group]) for group in over.groups]

    @cached_property
    def _middle(self) -> tuple[float, ...]:
        return tuple(p.grid[len(p.grid) // 2] for p in self._over[1].shapes)

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
        return self._averaged(side, self._over[side].columns(point))

    def _averaged(self, side: int, rows: Floats) -> Floats:
        return self.sides.averaged(side, [rows[own] for own in self._over[side].rows])

    def _discrepancy(self, effect: Floats, point: tuple[float, ...], amplitudes: Floats) -> Floats:
        over = self._over[1]
        count = len(over.amplitudes) * over.sets
        total = [np.zeros(count), np.zeros(count)]
        for when, own in zip(self._whens, np.split(amplitudes, len(self._whens)), strict=True):
            values = own[:count] + (own[count] if over.alike else 0.0)
            total[0] += when.of_a * values
            total[1] += when.of_b * values
        found = [np.zeros((len(effect), 0))]
        found += [self._slack(side, point, values) for side, values in enumerate(total) if values.any()]
        return np.hstack(found)

    def _slack(self, side: int, point: tuple[float, ...], amplitudes: Floats) -> Floats:
        over = self._over[side]
        return self._averaged(side, np.hstack(over.slack(over.effects(self._values(point, amplitudes)))))


def _as_derivative(effect: Effect) -> Effect:
    arrays = {field.name: getattr(effect, field.name) for field in fields(effect)}
    return Effect(**{name: None if array is None else np.asarray(array)[..., None] for name, array in arrays.items()})


CHANGE = 0.1
"""Usual change of geometry between sessions, relative to its usual error: manufacturing errors stay; collisions, new
reference runs or adjusted joints are a tenth."""

GEOMETRY = (*KINEMATIC_SOURCES, "platform-joints", "tool-ball-offset")
"""Sources of the machine's geometry."""

RESOLUTION_MM = 1e-5
"""Least noise per row of a difference [mm]: no bar has less, but simulations have zero."""


def channel_of(sides: Sides, sources: Sequence[ErrorSource]) -> Channel:
    """Make the channel of two sessions."""
    variables, runs = variables_of(sides), samples_of_b(sides)
    # Runs have constant speed, so rows are a clock.
    time = np.concatenate([np.arange(rows.stop - rows.start, dtype=np.float64) for rows in sides.blocks])
    return Channel(
        residual=sides.rows(lambda pair: pair.difference_mm),
        unit="mm",
        blocks=sides.blocks,
        names=tuple(pair.label for pair in sides.pairs),
        variables=variables,
        base=base_of(sides),
        laws=(*_changes(sides, sources), *set_up_laws(sides), *jig_laws(sides, runs)),
        time=time,
        time_unit="row",
        static=(*of_readings(variables, sides, time), *of_struts(sides, runs), of_each_test(sides)),
        least_noise=RESOLUTION_MM,
        interchangeable=EQUIVALENT**2,
        rows_are="tests",
    )


def _changes(sides: Sides, sources: Sequence[ErrorSource]) -> list[Law]:
    every = {(s.name, s.law): s for s in (*sources_named(KINEMATIC_SOURCES), *sources)}
    named = [s for s in every.values() if s.name not in MEASUREMENT_SOURCES]
    return [Change(s, sides, CHANGE if s.name in GEOMETRY else 1.0).law(NAMED_ODDS) for s in named]


OWN_LOBES = (2, 3, 4, 5)
"""Undulations per turn of separate curves for tests or runs, where most machine errors are."""


def variables_of(sides: Sides) -> tuple[Variable, ...]:
    """Return variables of unmodelled effects: angle, place, tilt, time."""
    circles = [pair.circle for pair in sides.pairs]
    per_run = [
        ("place in X", "mm", Kind.LENGTH, [circle.centre_mm[0] for circle in circles]),
        ("place in Y", "mm", Kind.LENGTH, [circle.centre_mm[1] for circle in circles]),
        ("height", "mm", Kind.LENGTH, [circle.centre_mm[2] for circle in circles]),
        ("tilt A", "deg", Kind.ANY, [circle.tilt_deg[0] for circle in circles]),
        ("tilt B", "deg", Kind.ANY, [circle.tilt_deg[1] for circle in circles]),
    ]
    found = [Variable("angle", "deg", Kind.ANGLE, sides.rows(lambda pair: pair.theta_deg), period=360.0)]
    found += [Variable(name, unit, kind, sides.each_row(values)) for name, unit, kind, values in per_run]
    return tuple(variable for variable in (*found, *_times(sides)) if variable.extent > 0.0)


def _times(sides: Sides) -> list[Variable]:
    found = {}
    for side, name in ((1, "time in B"), (0, "time in A")):
        times = [motion.time_s[motion.kept] for motion in sides.motions[side] if motion.time_s is not None]
        if len(times) == len(sides.pairs):
            found[name] = Variable(name, "s", Kind.TIME, sides.averaged(side, times))
    both = list(found.values())
    if len(both) > 1 and np.corrcoef(both[0].values, both[1].values)[0, 1] > EQUIVALENT:
        return both[:1]
    return both


def of_readings(variables: Sequence[Variable], sides: Sides, time: Floats) -> list[Pattern]:
    """Return effects on the reading; of speed only the direction matters."""
    every = patterns(variables, sides.blocks, time, None)
    return [pattern for pattern in every if pattern.family is not Family.SPEED]


def samples_of_b(sides: Sides) -> list[Samples]:
    """Return samples of B's runs with A's balls, for shapes."""
    pivot = np.mean([pair.circle.ball_mm for pair in sides.pairs], axis=0)
    return [
        samples_of(known, motion, sides.machine, reading, pivot)
        for known, motion, reading in zip(sides.variables[1], sides.motions[1], sides.readings[1], strict=True)
    ]


def of_struts(sides: Sides, runs: Sequence[Samples]) -> list[Pattern]:
    """Return unmodelled effects on struts, balls, table and tool; see `shapes`."""
    found = [
        _pattern(shape, sides, runs)
        for shape in shapes(ranges(runs))
        if (shape.variable, shape.moves) not in {("time", READING), ("angle since the start", READING)}
    ]
    return [pattern for pattern in found if pattern.samples.any()]


def _pattern(shape: Shape, sides: Sides, runs: Sequence[Samples]) -> Pattern:
    samples = sides.averaged(1, [shape.columns(run) for run in runs])
    values = sides.averaged(1, [shape.followed(run.values[shape.variable]) for run in runs])
    family = Family.CURVE if isinstance(shape.form, (LinearSplines, Lobes)) else Family.LINEAR
    if isinstance(shape.form, SignForm):
        family = Family.HYSTERESIS
    if shape.moves == SIGNED:
        family = Family.BY_DIRECTION
    followed = values if values.ndim == 1 else values[:, 0]
    # An effect that changes sign with a strut's direction is hysteresis of its length.
    name = "strut-length" if family is Family.HYSTERESIS else shape.variable
    variable = Variable(name, UNITS[shape.variable], Kind.ANY, followed)
    which = f"strut {shape.strut}" if shape.strut else "all struts" if shape.follows.moves_struts else ""
    label = " ".join(
        text for text in (which, shape.form.text("mm") if shape.moves not in {EVERY, SIGNED} else "") if text
    )
    tried = shape.tried * (STRUTS + 1 if shape.strut or which else 1)
    return Pattern.plain(family, (variable,), samples, shape.form, label or shape.moves, tried)


def of_each_test(sides: Sides) -> Pattern:
    """Return separate curves over the angle, for all tests or runs, or for one."""
    angle = sides.rows(lambda pair: pair.theta_deg)
    waves = Lobes(OWN_LOBES).columns(angle)
    tests = list(dict.fromkeys(pair.test for pair in sides.pairs))
    parts = [(f"test {t}", [k for k, pair in enumerate(sides.pairs) if pair.test == t]) for t in tests]
    parts += [(f"run {pair.label}", [k]) for k, pair in enumerate(sides.pairs)]
    width = waves.shape[1]
    samples = np.zeros((len(angle), width * len(parts)))
    own = [tuple(range(width * k, width * (k + 1))) for k in range(len(parts))]
    for (_, runs), columns in zip(parts, own, strict=True):
        for rows in (sides.blocks[k] for k in runs):
            samples[rows, columns[0] : columns[-1] + 1] = waves[rows]
    quarter, many = float(np.log(0.25)), len(tests)
    choices = [
        (tuple(range(width * many)), quarter, "each test its own"),
        (tuple(range(width * many, width * len(parts))), quarter, "each run its own"),
        *(
            (columns, quarter - float(np.log(len(sides.pairs) if k >= many else many)), name)
            for k, ((name, _), columns) in enumerate(zip(parts, own, strict=True))
        ),
    ]
    variable = Variable("angle, test by test", "deg", Kind.ANGLE, angle, period=360.0)
    return Pattern(Family.CURVE, (variable,), samples, Lobes(OWN_LOBES), choices=tuple(choices), acts_once=True)
