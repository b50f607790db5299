"""However a run is cut into stretches, every source does the same; and a stretch can be asked for again."""

from __future__ import annotations

import itertools
from dataclasses import fields, replace

import numpy as np
import pytest

from dbbstation.machine.geometry import Rotation
from dbbstation.sources.contract import Effect, ErrorSource, Need, Owner, Parameter
from dbbstation.sources.registry import known_sources
from tests.sources.runs import random_machine, random_run

SOURCES = list(known_sources().values())
SOURCES += [law for source in SOURCES for law in source.other_laws()]
AHEAD = {"time-skew", "run-start", "drive-friction"}


class Remembering(ErrorSource):
    """Somebody's own source, which says nothing of states: a share of the way since the first row."""

    name = "remembering"
    belongs_to = Owner.MACHINE
    needs = frozenset({Need.POSE, Need.PATH})

    def parameters(self, machine):  # noqa: ARG002
        return (Parameter("share_1", "1", 1e-6, "of the way"),)

    def effect(self, motion, machine, values):
        length = motion.struts(machine).length_mm
        return Effect(strut_mm=values[0] * np.abs(np.diff(length, axis=0, prepend=length[:1])).cumsum(axis=0))

    def derivative(self, motion, machine, values):
        raise NotImplementedError


def drawn(source, machine, rng):
    """Two or three times the usual size, of either sign for amplitudes."""
    parameters = source.parameters(machine)
    signs = np.array([1.0 if p.grid else rng.choice([-1.0, 1.0]) for p in parameters])
    return signs * rng.uniform(0.5, 3, len(parameters)) * [p.plausible for p in parameters]


def wandering(rng, count=300):
    """A path with stops, rows at one time and moves there and back of less than a micrometre."""
    motion = random_run(rng, count)
    poses, time_s = motion.poses.copy(), np.asarray(motion.time_s).copy()
    for at in rng.integers(5, count - 5, 6):
        poses[at : at + 3] = poses[at]
    at = int(rng.integers(20, count - 20))
    poses[at : at + 10] = poses[at] + np.outer(rng.uniform(-3e-4, 3e-4, 10), np.ones(6))
    twice = int(rng.integers(5, count - 5))
    time_s[twice] = time_s[twice - 1]
    return replace(motion, poses=poses, time_s=time_s, straight=True)


@pytest.mark.parametrize("source", [*SOURCES, Remembering()], ids=lambda s: f"{s.name}-{s.varies_with}")
def test_cuts_change_nothing(source, reference, rng):
    machine = random_machine(reference, next(iter(Rotation)), rng)
    assert source.looks_ahead == (source.name in AHEAD)
    if source.looks_ahead:
        return
    for _ in range(3):
        motion, values = wandering(rng), drawn(source, machine, rng)
        whole = source.effect(motion, machine, values)
        cuts = np.unique([0, *rng.integers(0, len(motion), rng.integers(1, 12)), len(motion)])
        state, parts = source.begin(motion, machine, values), []
        for first, last in itertools.pairwise(cuts):
            stretch = motion.stretch(slice(first, last))
            source.advance(stretch, machine, 2.0 * values, state)  # another try must leave the state as it is
            effect, state = source.advance(stretch, machine, values, state)
            parts.append(effect)
        for f in fields(whole):
            expected = getattr(whole, f.name)
            if expected is None:
                continue
            found = [getattr(part, f.name) for part in parts]
            if np.ndim(expected) and len(expected) == len(motion):
                assert np.allclose(np.concatenate(found), expected, rtol=0, atol=1e-12 + 1e-9 * np.abs(expected).max())
            else:
                assert all(np.array_equal(part, expected) for part in found)
