"""Inversion from the beginning on: against rounds over the whole path, against the model, and in any stretches."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import Frames
from dbbstation.machine.kinematics import forward, strut_lengths
from dbbstation.model.compensation import begun, compensated, compensated_on
from dbbstation.model.machine_model import MachineModel, actual_hexapod
from dbbstation.sources.contract import Effect, ErrorSource, Fitted, Motion, Need, Owner, Parameter
from dbbstation.sources.registry import known_sources

KNOWN = known_sources()
VALUES = {
    "backlash": [3.0, 5.0, -2.0, 4.0, 6.0, 1.0],
    "reversal-spike": [2.0, -1.0, 3.0, 2.0, 1.0, 2.5, 0.1],
    "play": [4.0, 3.0, 5.0, 2.0, 1.0, 6.0, 100.0],
    "joint-friction": [10.0, 5.0, 20.0, 10.0, 15.0, 8.0],
    "servo-lag": [3.0, -1.0, 2.0, 1.0, 0.0, 1.5],
}


def worn(reference, *names, kinematics=True):
    drawn = np.random.default_rng(24)
    base = (
        Fitted(KNOWN["strut-reference-length"], drawn.normal(0.0, 0.1, 6)),
        Fitted(KNOWN["base-joints"], drawn.normal(0.0, 0.2, 18)),
    )
    return MachineModel(reference, base * kinematics + tuple(Fitted(KNOWN[n], np.array(VALUES[n])) for n in names))


def part(rng, corners=8, step_mm=1.0):
    """Straight moves from corner to corner, as a program has them, at 1000 mm/min."""
    places = np.array([0, 0, -1010, 0, 0, 0]) + rng.uniform(-1, 1, (corners, 6)) * [60, 60, 30, 6, 6, 0]
    legs = [np.linspace(a, b, int(np.linalg.norm((b - a)[:3]) / step_mm) + 2)[1:] for a, b in pairwise(places)]
    poses = np.vstack([places[:1], *legs])
    way = np.concatenate([[0.0], np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1).cumsum()])
    return Motion(poses, is_path=True, straight=True, time_s=way * 60.0 / 1000.0)


def by_rounds(model, wanted, rounds=3000):
    """The brute force: the whole path again and again, each time with what the sources do to all of it, until it agrees."""
    hexapod, convention = model.machine.hexapod, model.machine.hexapod.rotation
    target = Frames.from_poses(wanted.poses, convention)
    motion, last = wanted, np.inf
    for _ in range(rounds):
        effect = model.effect(motion)
        driven = strut_lengths(actual_hexapod(hexapod, effect), target) - effect.strut_mm
        driven = driven + model.machine.reference_length_error_mm
        if np.abs(driven - last).max() < 1e-11:
            return motion.poses
        motion, last = replace(wanted, poses=forward(hexapod, driven, target).to_poses(convention)), driven
    raise AssertionError("the rounds do not agree")


@pytest.mark.parametrize(
    "names", [("backlash",), ("play",), ("joint-friction",), ("backlash", "joint-friction")], ids="+".join
)
def test_it_is_what_rounds_over_the_whole_path_come_to(reference, rng, names):
    model, wanted = worn(reference, *names), part(rng, 5, 4.0)
    assert np.allclose(compensated(model, wanted), by_rounds(model, wanted), rtol=0, atol=2e-9)


@pytest.mark.parametrize(
    "names",
    [
        ("backlash",),
        ("reversal-spike",),
        ("backlash", "reversal-spike"),
        ("play",),
        ("servo-lag",),
        ("joint-friction", "play"),
    ],
    ids="+".join,
)
def test_the_tool_goes_where_it_should(reference, rng, names):
    model, wanted = worn(reference, *names), part(rng, 14)
    commanded = compensated(model, wanted)
    driven = replace(wanted, poses=commanded)
    assert np.abs(model.actual_poses(wanted) - model.actual_poses(driven)).max() > 1e-3
    assert np.allclose(model.actual_poses(driven), wanted.poses, rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    "names", [("backlash", "reversal-spike"), ("servo-lag", "play"), ("joint-friction",)], ids="+".join
)
def test_stretches_change_nothing_and_can_be_tried_again(reference, rng, names):
    model, wanted = worn(reference, *names), part(rng, 6)
    whole = compensated(model, wanted)
    cuts = np.unique([0, *rng.integers(0, len(wanted), 9), len(wanted)])
    passed, found = begun(model, wanted), []
    for first, last in pairwise(cuts):
        stretch = wanted.stretch(slice(first, last))
        compensated_on(passed, wanted.stretch(slice(first, None)))  # tried with more rows, and thrown away
        poses, passed = compensated_on(passed, stretch)
        found.append(poses)
    assert np.allclose(np.vstack(found), whole, rtol=0, atol=5e-9)
    assert len(compensated_on(passed, wanted.stretch(slice(0, 0)))[0]) == 0


class Counted(ErrorSource):
    """A source that somebody wrote before there were states: one micrometre for each millimetre that the struts went."""

    name = "counted"
    belongs_to = Owner.MACHINE
    needs = frozenset({Need.POSE, Need.PATH})

    def parameters(self, machine):  # noqa: ARG002
        return (Parameter("share_1", "1", 1e-3, "of the way"),)

    def effect(self, motion, machine, values):
        length = motion.struts(machine).length_mm
        return Effect(strut_mm=values[0] * np.abs(np.diff(length, axis=0, prepend=length[:1])).cumsum(axis=0))

    def derivative(self, motion, machine, values):
        raise NotImplementedError


class Foreseeing(Counted):
    """One that knows where the run ends."""

    name = "foreseeing"
    looks_ahead = True


def test_a_source_without_states_is_compensated_all_the_same(reference, rng):
    model, wanted = MachineModel(reference, (Fitted(Counted(), np.array([1e-3])),)), part(rng, 4, 3.0)
    driven = replace(wanted, poses=compensated(model, wanted))
    assert np.allclose(model.actual_poses(driven), wanted.poses, rtol=0, atol=1e-8)


def test_one_that_looks_ahead_is_refused_with_what_to_change(reference, rng):
    model = MachineModel(reference, (Fitted(Foreseeing(), np.array([1e-3])),))
    with pytest.raises(ModelError, match="foreseeing cannot be compensated") as caught:
        compensated(model, part(rng, 3))
    assert "looks_ahead" in caught.value.remedy


class Stuck(Counted):
    """Struts that stay where they were at the beginning."""

    name = "stuck"

    def effect(self, motion, machine, values):  # noqa: ARG002
        length = motion.struts(machine).length_mm
        return Effect(strut_mm=length[:1] - length)


def test_a_machine_that_does_not_come_there_is_refused_with_the_pose(reference, rng):
    with pytest.raises(ModelError, match="no command leads the machine to the pose X"):
        compensated(MachineModel(reference, (Fitted(Stuck(), np.array([1.0])),)), part(rng, 3))
