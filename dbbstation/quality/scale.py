"""Check the gauge's scale by feed-in and feed-out."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import average_of
from dbbstation.quality.finding import Finding, Name, found, undecided
from dbbstation.quality.knowledge import form_columns
from dbbstation.quality.limits import quantile

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.quality.knowledge import Expected, Others, Seen


def scale(one: Seen, others: Others) -> Finding:
    """Judge the excess of measured over programmed feed-in and feed-out."""
    # Effects on the feed-in follow from effects on the circle. Over a distance w, a cause that depends on pose or time
    # changes by the share w / R. A cause that depends on the path acts fully, because it acts only in motion, at the
    # corner. Lag and play change sign with direction and cancel in the mean of both directions. The smaller of both
    # results counts.
    expected, feed_in_um = one.run.expected, 1e3 * one.run.circle.feed_in_mm
    if one.ways is None:
        return undecided(Name.SCALE, "feed-in and feed-out are not in the recording, or have too few samples")
    if expected is None:
        return undecided(Name.SCALE, "how far a sound machine misses the feed-in is not known")
    own_um = _excess_um(one)
    u_um = _u_um([(one, expected)])
    size, limit, counted = abs(own_um), quantile(np.inf) * u_um, own_um
    other = others.opposite
    if other is not None and other.ways is not None and other.run.expected is not None:
        both_um = 0.5 * (own_um + _excess_um(other))
        together = quantile(np.inf) * _u_um([(one, expected), (other, other.run.expected)])
        least = min(abs(both_um), abs(own_um))
        # Choose the result nearer its limit: the mean of both directions or this direction alone.
        if least * limit > size * together:
            size, limit, counted = least, together, both_um
    percent = 100.0 * counted / feed_in_um
    stated = f"feed-in and feed-out read {percent:+.2f} % more than their {one.run.circle.feed_in_mm:g} mm"
    return found(
        Name.SCALE,
        100.0 * size / feed_in_um,
        100.0 * limit / feed_in_um,
        stated,
        f"{stated}: check what the gauge counts per millimetre, at a gauge block, and the feed-in of plan and program",
        f"the gauge counts {percent:+.1f} % too much",
    )


def _excess_um(one: Seen) -> float:
    assert one.ways is not None  # noqa: S101 - asked before
    return average_of([way.way_um for way in one.ways]) - 1e3 * one.run.circle.feed_in_mm


def _u_um(runs: list[tuple[Seen, Expected]]) -> float:
    noise, effects = 0.0, dict[tuple[str, str], "Floats"]()
    for one, expected in runs:
        assert one.ways is not None  # noqa: S101 - asked before
        noise += sum(way.u_um**2 for way in one.ways) / (len(one.ways) * len(runs)) ** 2
        circle = one.run.circle
        theta = np.radians(circle.direction.sign * np.array([way.phi_deg for way in one.ways]))
        at_corners = form_columns(theta).mean(axis=0) / len(runs)
        for key, effect in expected.effects_um.items():
            share = 1.0 if key in expected.moving else circle.feed_in_mm / circle.bar_mm
            mine = share * (at_corners @ effect)
            effects[key] = effects[key] + mine if key in effects and effects[key].shape == mine.shape else mine
    return sqrt(noise + sum(float(each @ each) for each in effects.values()))
