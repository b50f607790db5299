"""How well predicted positions are known: beside many drawn machines, and what is said of what no recording determines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.machine.geometry import STRUTS
from dbbstation.model.identified import (
    IdentifiedModel,
    greatest_u_um,
    pose_errors,
    position_uncertainty_mm,
    predicted_poses,
    range_uncertainty_mm,
)
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted, Motion
from dbbstation.sources.registry import known_sources

SIZE_MM = 0.2
"""Of one joint coordinate of a machine of which nothing is stated."""

ALL_ALONG_Z = np.tile([0.0, 0.0, 1.0], STRUTS) / np.sqrt(STRUTS)


@pytest.fixture
def poses(rng):
    drawn = rng.uniform(-1.0, 1.0, (12, 6)) * [150.0, 150.0, 100.0, 10.0, 10.0, 0.0]
    return drawn - 1008.0 * np.eye(6)[2]


@pytest.fixture
def known(reference, rng):
    """A model of base joints: what is known of them to micrometres, their common height not at all."""
    source = known_sources()["base-joints"]
    spread = rng.normal(0.0, 0.001, (18, 18))
    spread -= np.outer(ALL_ALONG_Z, ALL_ALONG_Z @ spread)
    rows = tuple((source.name, "", p.name) for p in source.parameters(reference))
    model = MachineModel(reference, (Fitted(source, rng.normal(0.0, 0.05, 18)),))
    lost = ("all six base joints together along Z",)
    return IdentifiedModel(model, rows, spread @ spread.T, lost, null_space=SIZE_MM * ALL_ALONG_Z[None])


def test_what_moves_with_the_null_space_has_no_stated_uncertainty(known, poses):
    u_mm = position_uncertainty_mm(known, Motion(poses))
    assert np.isnan(u_mm[:, 2]).all()
    assert (u_mm[:, :2] < 0.02).all()
    assert known.why_unknown == "the recordings do not determine: all six base joints together along Z"


def test_the_greatest_uncertainty_of_each_axis_is_that_of_its_worst_pose(known, poses):
    each_mm = [position_uncertainty_mm(known, Motion(pose[None]))[0] for pose in poses]
    x_um, y_um, z_um = greatest_u_um(known, poses)
    assert [x_um, y_um] == pytest.approx([1e3 * max(one[axis] for one in each_mm) for axis in (0, 1)])
    assert z_um is None


def test_a_common_shift_is_no_part_of_positions_about_their_mean(known, poses):
    about = position_uncertainty_mm(known, Motion(poses), about_mean=True)
    assert (about < 0.02).all()


@pytest.mark.parametrize("about_mean", [False, True])
def test_uncertainty_is_the_scatter_of_drawn_machines(known, poses, rng, about_mean):
    determined = replace(known, directions_lost=(), null_space=None)
    stated = position_uncertainty_mm(determined, Motion(poses), about_mean=about_mean)
    (fitted,) = known.model.sources
    drawn = []
    for values in rng.multivariate_normal(fitted.values, known.covariance, 1500):
        machine = replace(known.model, sources=(replace(fitted, values=values),))
        at = machine.actual_poses(Motion(poses))[:, :3]
        drawn.append(at - at.mean(axis=0) if about_mean else at)
    assert np.allclose(np.std(drawn, axis=0), stated, rtol=0.1)


def test_the_smaller_part_along_the_null_space_is_part_of_the_uncertainty(known, poses):
    small = replace(known, null_space=1e-5 * ALL_ALONG_Z[None])
    both = position_uncertainty_mm(small, Motion(poses))
    alone = position_uncertainty_mm(replace(known, directions_lost=(), null_space=None), Motion(poses))
    # All six base joints together along Z move the tool by as much along Z: 1e-5 mm / √6 each.
    assert np.allclose(both[:, 2] ** 2 - alone[:, 2] ** 2, 1e-10 / STRUTS, rtol=1e-3)
    assert np.allclose(both[:, :2], alone[:, :2], rtol=1e-6)


def test_a_model_that_states_nothing_has_no_uncertainty(known, poses):
    """Written by hand, or by a program that does not say what its lost directions do."""
    by_hand = replace(known, covariance_rows=(), covariance=np.zeros((0, 0)), directions_lost=(), null_space=None)
    older = replace(known, null_space=None)
    for model, said in ((by_hand, "states no uncertainty"), (older, "an older program wrote the model")):
        assert np.isnan(position_uncertainty_mm(model, Motion(poses))).all()
        assert said in model.why_unknown


def test_a_source_without_a_row_in_the_covariance_leaves_nothing_known(known, poses):
    lengths = Fitted(known_sources()["strut-reference-length"], np.zeros(STRUTS))
    model = replace(known, model=replace(known.model, sources=(*known.model.sources, lengths)))
    assert np.isnan(position_uncertainty_mm(model, Motion(poses))).all()


def test_parameters_that_the_null_space_moves_have_no_stated_uncertainty(known):
    u = known.uncertainties
    assert u["base-joints", "", "joint_1_z_mm"] is None
    assert u["base-joints", "", "joint_1_x_mm"] == pytest.approx(np.sqrt(known.covariance[0, 0]))
    # Where six parameters are prescribed, they are the coordinates, and all others are known in these.
    prescribed = replace(known, report={"parameters_prescribed": ["base-joints.joint_1_z_mm"]})
    assert prescribed.uncertainties["base-joints", "", "joint_1_z_mm"] == pytest.approx(np.sqrt(known.covariance[2, 2]))


def test_what_a_formula_may_be_off_by_cancels_between_sessions(known):
    of_formulas = np.full(18, 0.03**2)
    model = replace(known, covariance=known.covariance + np.diag(of_formulas), formula_variance=of_formulas)
    between = model.uncertainties_between_sessions["base-joints", "", "joint_2_x_mm"]
    assert between == pytest.approx(np.sqrt(known.covariance[3, 3]))


def test_whole_numbers_of_poses_are_not_predicted_in_whole_numbers(known):
    whole = np.array([[10, 0, -1000, 0, 0, 0], [0, 50, -1100, 5, 0, 0]])
    actual, _ = predicted_poses(known, whole)
    expected, _ = predicted_poses(known, whole.astype(np.float64))
    assert np.array_equal(actual, expected)
    assert not np.array_equal(actual, np.round(actual))
    assert np.array_equal(predicted_poses(known, whole.tolist())[0], expected)


@pytest.mark.parametrize("axis", [1, 2])
def test_a_range_of_deviations_scatters_as_stated_over_drawn_machines(known, rng, axis):
    line = np.tile([0.0, 0.0, -1008.0, 0.0, 0.0, 0.0], (9, 1))
    line[:, 0] = np.linspace(-190.0, 190.0, 9)
    stated = range_uncertainty_mm(known, Motion(line), axis)
    (fitted,) = known.model.sources
    off = known.model.actual_poses(Motion(line))[:, axis] - line[:, axis]
    ends = Motion(line[[int(np.argmax(off)), int(np.argmin(off))]])
    apart = []
    for values in rng.multivariate_normal(fitted.values, known.covariance, 1500):
        at = replace(known.model, sources=(replace(fitted, values=values),)).actual_poses(ends)[:, axis]
        apart.append(at[0] - at[1])
    assert stated == pytest.approx(np.std(apart), rel=0.1)
    # A base that may be turned by a milliradian, about Z or about Y, makes a slope of the line.
    about = np.eye(3)[2 if axis == 1 else 1]
    turned = replace(
        known, null_space=1e-3 * np.cross(about, known.model.machine.hexapod.base_joints_mm).reshape(1, 18)
    )
    assert range_uncertainty_mm(turned, Motion(line), axis) is None


def test_a_summary_tells_the_common_shift_from_the_rest():
    """Two poses off by 3 and 5 µm along X: 4 µm together, 1 µm about that."""
    commanded = np.zeros((2, 6))
    actual = commanded + np.array([[0.003], [0.005]]) * np.eye(6)[0]
    told = pose_errors(commanded, actual, np.array([[1e-3, 2e-3, np.nan], [2e-3, 1e-3, np.nan]]))
    assert told.common_shift_um == pytest.approx([4.0, 0.0, 0.0])
    assert told.error_rms_um == pytest.approx(np.sqrt(17.0))
    assert told.error_about_mean_rms_um == pytest.approx(1.0)
    assert told.greatest_error_um == pytest.approx(5.0)
    assert told.greatest_uncertainty_by_axis_um == {"x": pytest.approx(2.0), "y": pytest.approx(2.0), "z": None}
    assert told.greatest_uncertainty_um is None
