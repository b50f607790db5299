"""Notes on differing conditions of two sessions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.compare.pairs import Pair
    from dbbstation.machine.geometry import Machine

SAME_TEMPERATURE_K = 0.5
"""Smaller differences of mean temperature are not reported: a bar of 150 mm grows by less than 1 µm."""


def notes_of(machine_a: Machine, machine_b: Machine, pairs: Sequence[Pair]) -> list[str]:
    """Return sentences on different machines, balls, programs, feeds and temperatures."""
    return [*_machines(machine_a, machine_b), *_balls(pairs), *_programs(pairs), *_feeds(pairs), *_temperatures(pairs)]


def _machines(a: Machine, b: Machine) -> list[str]:
    unlike = [
        name
        for name, one, other in (
            ("base joints", a.hexapod.base_joints_mm, b.hexapod.base_joints_mm),
            ("platform joints", a.hexapod.platform_joints_mm, b.hexapod.platform_joints_mm),
            ("reference lengths", a.reference_length_error_mm, b.reference_length_error_mm),
        )
        if not np.array_equal(one, other)
    ]
    if a.hexapod.rotation != b.hexapod.rotation:
        unlike.append("order of the tilt angles")
    if not unlike:
        return []
    names = f"{a.name} in A, {b.name} in B" if a.name != b.name else a.name
    return [
        (
            f"the nominal machines differ ({', '.join(unlike)}; {names}): differences of readings contain what the control's "
            "parameters were changed by; strut sensitivities are those of A"
        )
    ]


def _balls(pairs: Sequence[Pair]) -> list[str]:
    apart = {
        pair.test: 1e3 * float(np.abs(np.subtract(pair.a[0].raw.circle.ball_mm, pair.b[0].raw.circle.ball_mm)).max())
        for pair in pairs
    }
    worst = max(apart, key=lambda test: apart[test])
    notes = []
    if apart[worst] > 0.0:
        notes.append(
            f"the CMM sheets have other ball centres, by up to {apart[worst]:.1f} µm (test {worst}): each session is read "
            "about its own, so that differences contain what is wrong in either sheet"
        )
    lost = sorted({pair.test for pair in pairs for run in (*pair.a, *pair.b) if not run.setup.place_known})
    if lost:
        notes.append(f"the places of the balls of {', '.join(lost)} are unknown: centre shifts there do not count")
    return notes


def _programs(pairs: Sequence[Pair]) -> list[str]:
    by_program = [
        sum(any(run.commanded is not None for run in runs) for runs in side)
        for side in ([pair.a for pair in pairs], [pair.b for pair in pairs])
    ]
    if by_program[0] == by_program[1] == 0:
        return []
    return [
        (
            f"{by_program[0]} runs of A and {by_program[1]} of B were commanded by programs of their own: readings are held "
            "against the planned circle, so that differences contain what the programs compensate"
        )
    ]


def _feeds(pairs: Sequence[Pair]) -> list[str]:
    feeds = [(p.a[0].raw.circle.feed_mm_min, p.b[0].raw.circle.feed_mm_min) for p in pairs]
    unlike = [pair for pair in feeds if pair[0] != pair[1]]
    if not unlike:
        return []
    return [f"{len(unlike)} runs were travelled at other feeds, such as {unlike[0][0]:g} and {unlike[0][1]:g} mm/min"]


def _temperatures(pairs: Sequence[Pair]) -> list[str]:
    of_a = _means([run.raw.temperature_degc for pair in pairs for run in pair.a])
    of_b = _means([run.raw.temperature_degc for pair in pairs for run in pair.b])
    return [
        f"mean temperature of {sensor}: {of_a[sensor]:.1f} degC in A, {of_b[sensor]:.1f} degC in B"
        for sensor in of_a
        if sensor in of_b and abs(of_b[sensor] - of_a[sensor]) > SAME_TEMPERATURE_K
    ]


def _means(logs: Sequence[Mapping[str, Floats]]) -> dict[str, float]:
    sensors = set.intersection(*(set(log) for log in logs))
    return {sensor: float(np.mean([log[sensor].mean() for log in logs])) for sensor in sorted(sensors)}
