"""Refit with other runs or more sources."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.calibration.fit.calibrate import Calibration, calibrate

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource


def refitted(
    like: Calibration,
    observations: Sequence[Observation],
    more: Sequence[ErrorSource] = (),
    start: Mapping[str, Floats] | None = None,
) -> Calibration:
    """Fit runs with another fit's sources and values, and with further sources of `start`."""
    layout = like.layout
    sources = list({term.source.name: term.source for term in layout.terms}.values())
    begin = {
        term.source.name: like.x[term.columns]
        for term in layout.terms
        if any(parameter.grid for parameter in term.parameters)
    }
    return calibrate(layout.machine, observations, [*sources, *more], {**begin, **(start or {})})
