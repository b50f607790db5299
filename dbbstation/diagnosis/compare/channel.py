"""Two sessions as a channel: readings of A simulate B, circle by circle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit.calibrate import KINEMATIC_SOURCES, MEASUREMENT_SOURCES
from dbbstation.diagnosis.compare.causes import Change
from dbbstation.diagnosis.compare.set_up import base_of, jig_laws, set_up_laws
from dbbstation.diagnosis.compare.unnamed import of_each_test, of_readings, of_struts, samples_of_b, variables_of
from dbbstation.inference.alternatives import EQUIVALENT
from dbbstation.inference.channel import NAMED_ODDS, Channel
from dbbstation.sources.registry import sources_named

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.diagnosis.compare.sides import Sides
    from dbbstation.inference.channel import Law
    from dbbstation.sources.contract import ErrorSource

CHANGE = 0.1
"""Share of how wrong a machine's geometry may be that a change between two sessions usually is: what was made badly stays so; a
knock, a new reference run or a joint set anew is a tenth of it."""

GEOMETRY = (*KINEMATIC_SOURCES, "platform-joints", "tool-ball-offset")
"""Sources of what a machine is made like."""

RESOLUTION_MM = 1e-5
"""Noise that every difference has at the least, per row: no bar shows less, and simulations have none [mm]."""


def channel_of(sides: Sides, sources: Sequence[ErrorSource]) -> Channel:
    """Put two sessions on a channel."""
    variables, runs = variables_of(sides), samples_of_b(sides)
    # A run is travelled at one speed: its rows are its clock.
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
