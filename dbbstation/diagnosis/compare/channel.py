"""Two sessions as a channel: readings of A simulate B for each circle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit.calibrate import KINEMATIC_SOURCES, MEASUREMENT_SOURCES
from dbbstation.diagnosis.compare.causes import Change
from dbbstation.diagnosis.compare.set_up import base_of, jig_laws, set_up_laws
from dbbstation.diagnosis.shapes import EVERY, READING, SIGNED, UNITS, ranges, samples_of, shapes
from dbbstation.inference.alternatives import EQUIVALENT
from dbbstation.inference.channel import NAMED_ODDS, Channel
from dbbstation.inference.forms import LinearSplines, Lobes, SignForm
from dbbstation.inference.patterns import Family, Pattern, patterns
from dbbstation.inference.variables import Kind, Variable
from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.registry import sources_named

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.compare.sides import Sides
    from dbbstation.diagnosis.shapes import Samples, Shape
    from dbbstation.inference.channel import Law
    from dbbstation.sources.contract import ErrorSource

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
        samples_of(motion, sides.machine, reading, pivot)
        for motion, reading in zip(sides.motions[1], sides.readings[1], strict=True)
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
            (columns, quarter - float(np.log(many)), name)
            for (name, _), columns in zip(parts[:many], own, strict=False)
        ),
        *(
            (columns, quarter - float(np.log(len(sides.pairs))), name)
            for (name, _), columns in zip(parts[many:], own[many:], strict=True)
        ),
    ]
    variable = Variable("angle, test by test", "deg", Kind.ANGLE, angle, period=360.0)
    return Pattern(Family.CURVE, (variable,), samples, Lobes(OWN_LOBES), choices=tuple(choices), acts_once=True)
