"""Set-up errors of two sessions, within and beyond their stated size."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.channel import OUTSIZE, SET_UP, SETUP_ODDS
from dbbstation.diagnosis.shapes import LEVER_MM, TABLE
from dbbstation.inference.channel import Base, Law
from dbbstation.inference.harmonics import bands, basis
from dbbstation.inference.levels import BALL, BAR
from dbbstation.inference.triangle import ROUNDING, squares
from dbbstation.sources.registry import sources_named

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.compare.pairs import Pair, Sides
    from dbbstation.diagnosis.shapes import Samples
    from dbbstation.inference.levels import Followed
    from dbbstation.inference.settle import Settled
    from dbbstation.sources.contract import ErrorSource, Motion

JIG = "jig-position"
"""Name of a common displacement of all balls."""

JIG_MM = 0.05
"""Standard deviation per axis of a re-installed jig's displacement, and of its rotation at 100 mm [mm]."""

OF_THE_READING = frozenset({BALL, BAR, JIG, "angle", "reading", "commanded distance"})
"""Variables independent of struts and directions of travel, which effects of a ball, bar or holder may also follow."""

ALIKE = "alike in all tests: the set-up's"

ANYWHERE_MM = 1.0
"""Scatter of a ball of unknown place [mm]."""


def base_of(sides: Sides) -> Base:
    """Return the set-up effects of both sessions, with stated sizes."""
    names: list[str] = []
    columns: list[Floats] = []
    prior: list[Floats] = []
    for source in sources_named(SET_UP):
        for name, samples, sd in _stated(sides, source):
            seen = (sd > 0.0) & samples.any(axis=0)
            names += [f"{source.name} {name}"] * int(seen.sum())
            columns.append(samples[:, seen])
            prior.append(sd[seen])
    for k, pair in enumerate(sides.pairs):
        start_deg = float(np.linalg.norm([runs[k].raw.start_uncertainty_deg for runs in sides.runs]))
        if start_deg > 0.0:
            names.append(f"run-start {pair.label}")
            columns.append(np.zeros((sides.blocks[-1].stop, 1)))
            columns[-1][sides.blocks[k], 0] = _per_degree(pair)[sides.orders[k]]
            prior.append(np.array([start_deg]))
    every = np.concatenate(prior)
    return Base(tuple(names), np.hstack(columns), every, np.ones(len(every), dtype=bool))


def _per_degree(pair: Pair) -> Floats:
    """Return the slope of A's smooth curve over angle, for shifted starts, shape (s,) [mm/deg]."""
    theta, there = np.radians(pair.theta_deg), np.isfinite(pair.a_mm)
    low, _ = bands(len(theta))
    found, *_ = np.linalg.lstsq(basis(theta[there], low), pair.a_mm[there], rcond=None)
    order = np.arange(1, low + 1)
    by_angle = np.concatenate([[0.0], order * found[low + 1 :], -order * found[1 : low + 1]])
    return np.radians(1.0) * (basis(theta, low) @ by_angle)


def _stated(sides: Sides, source: ErrorSource) -> list[tuple[str, Floats, Floats]]:
    """Return tests that share a source's values, with its columns, shape (n, p), and stated sizes, shape (p,) [mm]."""
    # If runs share the error in both sessions, the variances add.
    shared = [[source.shared_by(motion) for motion in motions] for motions in sides.motions]
    together = list(zip(*shared, strict=True))
    alike = len(set(together)) == len(set(shared[0])) == len(set(shared[1]))
    zeros = np.zeros(len(source.parameters(sides.machine)))
    each = sides.averaged(1, [reading.by_source(source, sides.machine, zeros) for reading in sides.readings[1]])
    found = []
    for keys in [together] if alike else shared:
        for key in dict.fromkeys(keys):
            runs = [k for k, name in enumerate(keys) if name == key]
            samples = np.zeros_like(each)
            for rows in (sides.blocks[k] for k in runs):
                samples[rows] = each[rows]
            one, other = (_sd(source, motions[runs[0]]) for motions in sides.motions)
            sd = np.hypot(one, other) if alike else (one if keys is shared[0] else other)
            found.append((", ".join(dict.fromkeys(sides.pairs[k].test for k in runs)), samples, sd))
    return found


def _sd(source: ErrorSource, motion: Motion) -> Floats:
    stated = source.stated_mm(motion)
    known = np.zeros(0) if stated is None else stated
    lost = source.name == "mounting" and motion.setup is not None and not motion.setup.place_known
    return np.full(len(known), ANYWHERE_MM) if lost else known


def set_up_laws(sides: Sides) -> list[Law]:
    """Return laws for balls and bars with errors beyond their stated size, of one or of all."""
    found: list[Law] = []
    named: set[tuple[str, ...]] = set()
    for source in sources_named(SET_UP):
        sets = _stated(sides, source)
        names = tuple(name for name, _, _ in sets)
        # For a ball mounted once, ball and mounting are one effect.
        once = source.name == "ball-coordinate" and names in named
        named.add(names)
        if not once and all(sd.max(initial=0.0) < ANYWHERE_MM for _, _, sd in sets):
            found += _outsize(source, [p.name for p in source.parameters(sides.machine)], sets)
    return found


def _outsize(source: ErrorSource, parameters: Sequence[str], sets: Sequence[tuple[str, Floats, Floats]]) -> list[Law]:
    """Return laws for one source's errors beyond stated size; may be empty."""
    names: list[str] = []
    choices: list[tuple[tuple[int, ...], float, str]] = []
    columns, plausible = [], []
    for tests, samples, sd in sets:
        seen = np.flatnonzero((sd > 0.0) & samples.any(axis=0))
        if len(seen):
            choices.append((tuple(range(len(names), len(names) + len(seen))), 0.0, f"test {tests}"))
            names += [f"{parameters[k]} of {tests}" for k in seen.tolist()]
            columns.append(samples[:, seen])
            plausible.append(OUTSIZE * sd[seen])
    if not names:
        return []
    single = -float(np.log(2.0 * len(choices)))
    every = (tuple(range(len(names))), -float(np.log(2.0)), "every one of them")
    several = (*((own, single, label) for own, _, label in choices), every)
    samples = np.hstack(columns)
    return [
        Law(
            name=source.name,
            columns=lambda _: samples,
            plausible=np.concatenate(plausible),
            parameters=tuple(names),
            units=("mm",) * len(names),
            log_odds=SETUP_ODDS,
            choices=several if len(choices) > 1 else (),
            acts_once=True,
            followed=(BAR if source.name == "bar-offset" else BALL,),
        )
    ]


def jig_laws(sides: Sides, runs: Sequence[Samples]) -> list[Law]:
    """Return laws for a shift and rotations common to all balls."""
    samples = sides.averaged(1, [run.gain[TABLE] for run in runs])
    seen = np.flatnonzero(np.abs(samples).max(axis=0) > ROUNDING)
    names = [f"{name}_mm" for name in "xyz"] + [f"turn_{name}_rad" for name in "xyz"]
    per = np.array([1.0] * 3 + [LEVER_MM] * 3)
    if len({pair.test for pair in sides.pairs}) < 2:  # noqa: PLR2004 - a single ball's displacement is its own
        return []
    return [
        Law(
            name=JIG,
            columns=lambda _: samples[:, seen] * per[seen],
            plausible=JIG_MM / per[seen],
            parameters=tuple(names[k] for k in seen),
            units=tuple(("mm", "rad")[k // 3] for k in seen),
            log_odds=SETUP_ODDS,
        )
    ]


def alike_in_all(one: Followed, sides: Sides, settled: Settled) -> bool:
    """Return whether a class without strut or direction is the same curve over the angle in several tests."""
    several = len({pair.test for pair in sides.pairs}) > 1
    if not several or not OF_THE_READING.issuperset(name for names in one.variables for name in names):
        return False
    by_run = np.array(sides.by_angle(settled.effect(one.members)))
    whole = len(by_run) * squares(by_run.mean(axis=0))
    return whole >= settled.channel.interchangeable * squares(by_run) > 0.0


def with_set_up(follows: Sequence[Followed], sides: Sides, settled: Settled) -> tuple[Followed, ...]:
    """Attribute classes that are equal in all tests to the set-up, and return all classes."""
    return tuple(replace(one, where=ALIKE) if alike_in_all(one, sides, settled) else one for one in follows)
