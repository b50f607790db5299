"""Curves of found sources: the model's by their equations, the readings' by brute force."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.diagnosis.findings import Unexplained
from dbbstation.diagnosis.shapes import READING, SIGNED, Follows
from dbbstation.diagnosis.source_curves import SEEN, found_sources, source_curves
from dbbstation.inference.bounds import BOUNDS
from dbbstation.machine.geometry import Frames
from dbbstation.machine.kinematics import strut_lengths
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Effect, Fitted, LinearSource, Owner, Parameter
from tests.diagnosis.joint_fits import CONSTANT_S, DRIFT_UM, PLAY_UM, joint_fit


@pytest.fixture(scope="module")
def both(reference):
    return joint_fit(reference, ("backlash", "bar-drift"))


@pytest.fixture(scope="module")
def curves(both):
    return {one.source: one for one in source_curves(both)}


class OneStrut(LinearSource):
    """Strut 3 longer by a number, to take derivatives by differences."""

    name = "one-strut"
    belongs_to = Owner.MACHINE

    def parameters(self, machine):  # noqa: ARG002
        return (Parameter("x_mm", "mm", 1.0, ""),)

    def derivative(self, motion, machine, values):  # noqa: ARG002
        return Effect(strut_mm=np.eye(6)[:, 2:3])


def test_found_are_those_that_the_base_model_has_not(both):
    assert found_sources(both) == ("backlash", "bar-drift")
    assert [one.source for one in source_curves(both)] == ["backlash", "bar-drift"]


def test_play_has_two_branches_half_of_it_each_side(curves):
    play = curves["backlash"]
    assert (play.variable, play.unit, play.reading) == ("strut-length", "mm", ())
    assert len(play.struts) == 6
    for branches in play.struts:
        assert [branch.sense for branch in branches] == ["lengthening", "shortening"]
        for branch, side in zip(branches, (-1.0, 1.0), strict=True):
            # The equation: -w/2 while growing; only the few micrometres after a reversal lie between.
            assert branch.model_um == pytest.approx(np.full(BOUNDS.curve_pieces, side * PLAY_UM / 2), abs=0.3)
            off = (branch.after_um - branch.model_um) / branch.sigma_um
            assert np.sqrt(np.mean(off**2)) < 2.0


def test_a_strut_that_moves_nothing_of_the_kind_is_no_strut_curve(curves):
    drift = curves["bar-drift"]
    assert (drift.variable, drift.unit, drift.struts) == ("time", "s", ())
    (branch,) = drift.reading
    truth = DRIFT_UM * -np.expm1(-branch.variable / CONSTANT_S)
    assert branch.model_um == pytest.approx(truth, abs=0.2)
    assert branch.after_um == pytest.approx(truth, abs=0.25)
    # What the base model leaves of a reading is its mean there: the whole of the drift less what the bar's offset took.
    assert np.ptp(branch.before_um) > 1.0


def test_readings_of_a_strut_are_least_squares_of_its_residual_alone(both, curves):
    """Strut 3 while it grows: responses by differences, pieces and least squares written out."""
    length, sign, gain, model, left = [], [], [], [], []
    fit, step = both.after, 1e-3
    hexapod = fit.model.machine.hexapod
    play = MachineModel(fit.model.machine, tuple(f for f in fit.model.sources if f.source.name == "backlash"))
    for observation, residual in zip(fit.observations, fit.residual_mm, strict=True):
        motion = observation.motion()
        strut = strut_lengths(hexapod, Frames.from_poses(motion.poses, hexapod.rotation))[:, 2]
        ends = [
            MachineModel(fit.model.machine, (*fit.model.sources, Fitted(OneStrut(), np.array([x])))).bar(motion)
            for x in (-step, step)
        ]
        length.append(strut[motion.kept])
        sign.append(np.sign(np.diff(strut, prepend=2 * strut[0] - strut[1]))[motion.kept])
        gain.append((ends[1].length_mm - ends[0].length_mm) / (2 * step))
        model.append(play.effect(motion).strut_mm[motion.kept, 2])
        left.append(residual)
    length, sign, gain, model, left = map(np.concatenate, (length, sign, gain, model, left))
    edges = np.linspace(length.min(), length.max(), BOUNDS.curve_pieces + 1)
    branch = curves["backlash"].struts[2][0]
    for k in range(BOUNDS.curve_pieces):
        rows = (sign > 0) & (length >= edges[k]) & ((length < edges[k + 1]) | (k == BOUNDS.curve_pieces - 1))
        (alone,), *_ = np.linalg.lstsq(gain[rows, None], left[rows], rcond=None)
        assert branch.variable[k] == pytest.approx(length[rows].mean())
        assert branch.model_um[k] == pytest.approx(1e3 * model[rows].mean(), abs=1e-6)
        assert branch.after_um[k] - branch.model_um[k] == pytest.approx(1e3 * alone, rel=1e-4, abs=1e-5)
        sigma = 1e3 * both.left.noise / np.sqrt(np.sum(gain[rows] ** 2))
        assert branch.sigma_um[k] == pytest.approx(sigma, rel=1e-4)


def test_gravity_is_drawn_over_the_force(reference):
    (gravity,) = source_curves(joint_fit(reference, ("gravity",)))
    assert (gravity.source, gravity.variable, gravity.unit) == ("gravity", "strut-force", "N")
    for (branch,) in gravity.struts:
        assert np.all(np.sign(branch.model_um) == np.sign(branch.variable))  # tension makes a strut longer
        # 9.7 µm/kN at 1000 mm; struts of this plan are shorter, and softer or stiffer by what grows with length.
        slope = branch.model_um[np.abs(branch.variable) > 300] / branch.variable[np.abs(branch.variable) > 300]
        assert np.all((slope > 9.7e-3 * 0.3) & (slope < 9.7e-3 * 1.3))


@pytest.mark.parametrize(
    ("follows", "over", "panels"),
    [
        (Follows("strut-length", "wave"), "strut-length", (6, 0)),
        (Follows("strut-length", "", SIGNED), "strut-length", (6, 0)),
        (Follows("angle", "", READING), "angle", (0, 1)),
    ],
    ids=str,
)
def test_what_has_no_name_is_drawn_by_what_organises_it(reference, follows, over, panels):
    rest = Unexplained(1.0, 2, follows, 30.0, "An error without a known name.")
    (one,) = source_curves(joint_fit(reference, ("backlash",), unexplained=rest))
    assert (one.source, one.variable) == ("", over)
    assert (len(one.struts), len(one.reading)) == panels
    if one.struts:
        senses = ["lengthening", "shortening"] if follows.moves == SIGNED else [""]
        assert [branch.sense for branch in one.struts[0]] == senses
    branch = one.struts[1][0] if one.struts else one.reading[0]
    assert np.all(branch.model_um == 0.0)
    assert branch.after_um == pytest.approx(branch.before_um, nan_ok=True)
    left_open = np.isnan(branch.after_um)
    assert np.all(branch.sigma_um[left_open] > SEEN * np.median(branch.sigma_um))
    assert not left_open.all()
    assert one.fine or not left_open.any()
    assert len(branch.variable) > BOUNDS.curve_pieces if one.fine else len(branch.variable) == BOUNDS.curve_pieces


def test_nothing_found_nothing_drawn(reference):
    assert source_curves(joint_fit(reference, ())) == ()
