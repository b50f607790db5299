"""Two sessions as a channel: readings of A simulate B for each circle."""

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
