"""Check imported numbers: units against bars and circles, centres against the plan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import range_of, sum_of
from dbbstation.facts.quantities import FULL_TURN_DEG, USUAL_STROKE_MM
from dbbstation.files.formats.mapping import ANGLE, DEVIATION, LENGTH, TIME, UNITS
from dbbstation.tasks.importing.travel import UnusableTravelError
from dbbstation.trace.cut import LARGEST_JUMP_MM

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.files.formats.mapping import MappingFile
    from dbbstation.files.recordings.table_csv import TableFile
    from dbbstation.plan.plan import Ball, Circle

LEAST_RANGE_MM = 2e-4
"""Least range of a bar's readings over a turn [mm]: bars resolve 0.1 µm, and their noise alone spans more."""

LIKE_A_UNIT = 0.1
"""Largest relative difference between a ratio of numbers and the ratio of two units that it indicates."""

MOST_TURNS = 2.0
"""Greatest number of turns in the angles of one run, with overshoot."""

CHANCE = 1e-3
"""Probability below which centres are nearer to their commanded places than balls can be put up."""


@dataclass(frozen=True)
class Implausible:
    """Numbers that contradict their meaning."""

    what: str
    means: str
    others: tuple[str, ...]


def unlike_a_bar(
    numbers: Floats, means: str, unit: str, zero_mm: float, circle: Circle, feed_in_mm: float | None = None
) -> Implausible | None:
    """Return why a turn's readings contradict their unit, if another unit fits, else None.

    Args:
        means: `length` or `deviation`.
        zero_mm: length at deviation 0.
        feed_in_mm: feed-in that the readings include; None for a turn alone.
    """
    least_mm = LEAST_RANGE_MM if feed_in_mm is None else max(LEAST_RANGE_MM, 0.5 * feed_in_mm)

    def fits(one: str, meant: str = means) -> bool:
        lengths = numbers * UNITS[means][one] + (zero_mm if meant == DEVIATION else 0.0)
        off = float(np.max(np.abs(lengths - circle.bar_mm)))
        jump = float(np.max(np.abs(np.diff(lengths)), initial=0.0))
        return range_of(lengths) >= least_mm and off <= USUAL_STROKE_MM and jump <= LARGEST_JUMP_MM

    if len(numbers) == 0 or fits(unit):
        return None
    swapped = LENGTH if means == DEVIATION else DEVIATION
    if zero_mm and fits(unit, swapped):
        others: tuple[str, ...] = (f"{swapped}:{unit}",)
    else:
        others = tuple(f"{means}:{one}" for one in UNITS[means] if one != unit and fits(one))
    if not others:
        return None
    low, high = float(numbers.min()), float(numbers.max())
    said = "lengths" if means == LENGTH else "deviations"
    what = f"{said} from {low:.6g} to {high:.6g} {unit} are none of a ball bar of {circle.bar_mm:g} mm"
    return Implausible(what, means, others)


def unlike_a_turn(theta_deg: Floats, unit: str) -> Implausible | None:
    """Return why angles contradict their unit, if another unit gives a turn, else None."""
    span = range_of(theta_deg) / UNITS[ANGLE][unit]
    turns = [
        f"{ANGLE}:{one}"
        for one, degrees in UNITS[ANGLE].items()
        if one != unit and 1.0 - LIKE_A_UNIT <= span * degrees / FULL_TURN_DEG <= MOST_TURNS
    ]
    if span * UNITS[ANGLE][unit] >= (1.0 - LIKE_A_UNIT) * FULL_TURN_DEG or not turns:
        return None
    return Implausible(f"angles span {span:.4g} {unit}, which is no turn", ANGLE, tuple(turns))


def unlike_the_feed(t_s: Floats, theta_deg: Floats, unit: str, circle: Circle) -> Implausible | None:
    """Return why times contradict their unit, if another unit gives the plan's feed, else None."""
    turned = sum_of(np.abs(np.diff(np.unwrap(theta_deg, period=FULL_TURN_DEG))))
    took = float(t_s[-1] - t_s[0]) if len(t_s) > 1 else 0.0
    if took <= 0.0 or turned <= 0.0:
        return None
    ratio = turned / circle.turning_deg_s / took  # what the time should be over what it is
    own = UNITS[TIME][unit]
    others = tuple(
        f"{TIME}:{one}"
        for one, seconds in UNITS[TIME].items()
        if one != unit and abs(ratio * own / seconds - 1.0) <= LIKE_A_UNIT
    )
    if not others:
        return None
    feed = circle.feed_mm_min * ratio
    return Implausible(
        f"times and angles make a feed of {feed:.4g} mm/min, the plan has {circle.feed_mm_min:g}", TIME, others
    )


def check_units(
    mapping: MappingFile,
    table: TableFile,
    rows: Integers,
    values: Mapping[str, Floats],
    circle: Circle,
) -> None:
    """Refuse numbers that contradict their unit if another unit fits.

    Raises:
        UnusableTravelError: names the fitting units.
    """
    means = LENGTH if LENGTH in values else DEVIATION
    named = {one: name for one in (means, ANGLE, TIME) if (name := mapping.column(one)) is not None}
    units = {one: mapping.columns[name].unit or "" for one, name in named.items()}
    whole = ANGLE not in values and mapping.trace == "whole"
    found = unlike_a_bar(
        table.values[named[means]][rows],
        means,
        units[means],
        float(mapping.zero_mm or 0.0),
        circle,
        circle.feed_in_mm if whole else None,
    )
    if found is None and ANGLE in values:
        found = unlike_a_turn(values[ANGLE], units[ANGLE])
        if found is None and TIME in values:
            found = unlike_the_feed(values[TIME], values[ANGLE], units[TIME], circle)
    if found is None:
        name = named[means]
        numbers = table.values[name][rows]
        if len(numbers) > 1 and range_of(numbers) == 0.0:
            raise UnusableTravelError(
                f"column {table.names.index(name) + 1}, {name}: it is {float(numbers[0]):g} in every row of the run, which is impossible for a gauge",
                "the column may hold nominal values: name another with --columns, or accept the numbers with --trust unit",
            )
        return
    name = named[found.means]
    meant = " or ".join(one.replace(":", " in ") for one in found.others)
    say = " or ".join(f"--columns '{name}={one}'" for one in found.others)
    raise UnusableTravelError(
        f"column {table.names.index(name) + 1}, {name}: {found.what}",
        f"it may be {meant}: give {say}, or correct the mapping; --trust unit accepts the numbers as they are",
    )


def centre_mm(length_mm: Floats, theta_deg: Floats) -> Floats:
    """Return the least-squares centre, shape (2,) [mm], from the first harmonic."""
    angle = np.radians(theta_deg)
    columns = np.column_stack([np.ones_like(angle), np.cos(angle), np.sin(angle)])
    found: Floats = np.linalg.lstsq(columns, length_mm, rcond=None)[0][1:]
    return found


def chance_of_centres(centres: Iterable[tuple[Ball, Sequence[Floats]]]) -> float | None:
    """Return the probability that raw circles are by chance so near to their commanded centres; None if unknown.

    Each axis of a centre scatters at least by CMM and holder (sigma). So a distance up to r has a probability of at
    most 1 - exp(-r² / (2 sigma²)). Fisher's method combines independent balls.

    Args:
        centres: of each ball with known place, its runs' centres, shape (2,) each [mm].
    """
    logs = []
    for ball, found in centres:
        variance = ball.uncertainty_mm**2 + ball.repeatability_mm**2
        if not ball.place_known or variance <= 0.0 or not found:
            continue
        distance2 = sum_of(np.mean(found, axis=0) ** 2)
        logs.append(np.log(max(-np.expm1(-distance2 / (2.0 * variance)), np.finfo(float).tiny)))
    if not logs:
        return None
    from scipy.special import chdtrc

    return float(chdtrc(2 * len(logs), -2.0 * sum(logs)))
