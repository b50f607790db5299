"""The paper's three ways to calibrate: what each can and cannot know, against a fit written another way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from dbbstation.calibration.fit.calibrate import calibrate, default_sources
from dbbstation.calibration.fit.methods import Method, as_known
from dbbstation.calibration.layout import lay_out
from dbbstation.errors import CalibrationError
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources
from dbbstation.trace.analysis import centred, figures
from dbbstation.virtual.truth import random_kinematics
from studies.virtual_session import draw_session

NOISE_MM = 0.0005
RIGID = [f"all six base joints together along {axis}" for axis in "XYZ"] + [
    f"all six base joints turned together about {axis}" for axis in "XYZ"
]


@pytest.fixture(scope="module")
def machine():
    return read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")


def plan(name):
    return read_plan(shipped_folder("protocols") / "plans" / f"{name}.yaml")


@pytest.fixture(scope="module")
def truth(machine):
    return MachineModel(machine, random_kinematics(machine, 3))


@pytest.fixture(scope="module")
def under_spindle(truth):
    return draw_session(truth, plan("conventional"), np.random.default_rng(1), NOISE_MM, 72, micrometer_mm=0.001)


@pytest.fixture(scope="module")
def on_jig(truth):
    return draw_session(truth, plan("table2"), np.random.default_rng(1), NOISE_MM, 72)


@pytest.fixture(scope="module")
def conv_a(machine, under_spindle):
    return calibrate(machine, as_known(Method.CONV_A, machine, under_spindle), prescribe=())


def test_centre_compensation_loses_the_six_rigid_motions(conv_a):
    """ "At least six parameters must be prescribed" [CAL III-A-2]."""
    assert conv_a.parameters_identified == 18
    assert sorted(conv_a.directions_lost) == sorted(RIGID)
    assert len(conv_a.prescribed) == 6
    for source, parameter in conv_a.prescribed:
        column = conv_a.layout.names.index((source, "", parameter))
        assert conv_a.x[column] == pytest.approx(0.0, abs=1e-12)
        assert conv_a.solution.covariance[column, column] == pytest.approx(0.0, abs=1e-20)


@pytest.mark.slow
def test_a_free_place_of_the_ball_is_centre_compensation(machine, truth):
    """The same circles, each with its least-squares centre taken out of measured and predicted lengths alike
    [CAL eq 6], fitted by a general solver: the same parameters to a small part of their uncertainty.

    On a machine that is wrong by hundredths, about balls that are not: centre compensation takes the commanded angle for the bar's, which
    errs by the square of what is compensated over the radius."""
    slightly = MachineModel(machine, tuple(replace(f, values=0.1 * f.values) for f in truth.sources))
    rng = np.random.default_rng(1)
    runs = draw_session(slightly, plan("table2"), rng, NOISE_MM, 72)
    conv_a = calibrate(machine, as_known(Method.CONV_A, machine, runs), prescribe=())
    layout = lay_out(machine, [s for s in default_sources() if s.belongs_to == "machine"], runs)
    held = [layout.names.index((source, "", name)) for source, name in conv_a.prescribed]
    free = np.setdiff1d(np.arange(24), held)
    measured = [centred(o.raw) for o in runs]
    known = [replace(o, setup=replace(o.setup, place_known=True)) for o in runs]

    def deviation(values):
        x = np.zeros(24)
        x[free] = values[:-1]
        model = layout.model(x)
        left = [
            circle.deviation_mm + circle.radius_mm - compensated.deviation_mm - compensated.radius_mm - values[-1]
            for circle, compensated in zip(
                measured,
                [centred(replace(o.raw, length_mm=model.bar(o.motion()).length_mm)) for o in known],
                strict=True,
            )
        ]
        # The bar's length error is known to half a µm, as the session says.
        return np.append(np.concatenate(left) / NOISE_MM, values[-1] / 0.0005)

    start = np.append(conv_a.x[free] + np.random.default_rng(2).normal(0, 0.005, len(free)), 0.0)
    solved = least_squares(deviation, start, x_scale="jac", xtol=1e-9, ftol=1e-9, gtol=1e-9)
    sigma = np.sqrt(np.diag(conv_a.solution.covariance)[free])
    assert np.abs((solved.x[:-1] - conv_a.x[free]) / sigma).max() < 0.1


def test_whichever_six_are_prescribed_the_circles_are_explained_alike(machine, under_spindle, conv_a):
    chosen = [("base-joints", f"joint_{place}_mm") for place in ("1_x", "1_y", "1_z", "3_y", "3_z", "5_z")]
    other = calibrate(machine, as_known(Method.CONV_A, machine, under_spindle), prescribe=chosen)
    assert set(other.prescribed) == set(chosen) != set(conv_a.prescribed)
    for a, b in zip(conv_a.residual_mm, other.residual_mm, strict=True):
        assert np.abs(a - b).max() < 2e-5  # second order: a tenth of a millimetre over half a metre
    assert other.noise.sigma == pytest.approx(NOISE_MM, rel=0.05)


def test_micrometer_readings_tell_more_but_no_global_position(machine, under_spindle, conv_a):
    conv_b = calibrate(machine, as_known(Method.CONV_B, machine, under_spindle), prescribe=conv_a.prescribed)
    assert sorted(conv_b.directions_lost) == sorted(RIGID)
    sigma_a, sigma_b = (np.sqrt(np.diag(c.solution.covariance)[:24]) for c in (conv_a, conv_b))
    known = sigma_a > 0.0
    assert np.all(sigma_b[known] < 1.01 * sigma_a[known])
    assert np.median(sigma_b[known] / sigma_a[known]) < 1.0
    # How far a circle's centre is off against where the machine stood when its ball was put up.
    for observation, residual in zip(conv_b.observations, conv_b.residual_mm, strict=True):
        off = figures(observation.raw, observation.raw.circle.bar_mm + residual)
        assert off.centre_deviation_um < 0.5


def test_balls_on_a_jig_serve_the_conventional_methods_too(machine, on_jig):
    calibration = calibrate(machine, as_known(Method.CONV_A, machine, on_jig), prescribe=())
    assert calibration.parameters_identified == 18


def test_the_jig_method_refuses_balls_of_unknown_place(machine, under_spindle):
    with pytest.raises(CalibrationError, match="put up under the spindle in test a, b"):
        as_known(Method.JIG, machine, under_spindle)


def test_conv_b_refuses_circles_without_micrometer_readings(machine, on_jig):
    with pytest.raises(CalibrationError, match="no set-up errors were measured in test a"):
        as_known(Method.CONV_B, machine, on_jig)


def test_recordings_with_their_centres_removed_are_refused(machine, on_jig):
    compensated = []
    for observation in on_jig:
        circle = centred(observation.raw)
        length = np.round(circle.radius_mm + circle.deviation_mm, 4)
        compensated.append(replace(observation, raw=replace(observation.raw, length_mm=length)))
    with pytest.raises(CalibrationError, match="centre compensation"):
        as_known(Method.JIG, machine, compensated)
    assert calibrate(machine, as_known(Method.CONV_A, machine, compensated), prescribe=()).parameters_identified == 18


def test_parameters_that_do_not_hold_what_is_lost_are_refused(machine, under_spindle):
    runs = as_known(Method.CONV_A, machine, under_spindle)
    heights = [("base-joints", f"joint_{i}_z_mm") for i in range(1, 7)]
    with pytest.raises(CalibrationError, match="do not hold every direction"):
        calibrate(machine, runs, prescribe=heights)
    with pytest.raises(
        CalibrationError, match="5 parameters are prescribed, but these tests leave 6 directions undetermined"
    ):
        calibrate(machine, runs, prescribe=heights[:5])
    with pytest.raises(CalibrationError, match="joint_7_z_mm cannot be prescribed"):
        calibrate(machine, runs, prescribe=[("base-joints", "joint_7_z_mm")])


def test_what_no_run_depends_on_is_prescribed_itself(machine, on_jig):
    sources = [*default_sources(), known_sources()["thermal-frame"]]
    calibration = calibrate(machine, on_jig, sources, prescribe=())
    assert ("thermal-frame", "pause_loss_um_m") in calibration.prescribed
    assert "thermal-frame pause loss um m" in calibration.directions_lost
    assert len(calibration.prescribed) == len(calibration.directions_lost)


def test_a_tolerance_of_the_machine_file_stands_in_for_what_is_lost_and_is_said_to(machine, on_jig):
    without = calibrate(machine, on_jig)
    assert (without.directions_lost, without.directions_regularised) == ((RIGID[2],), ())
    tolerant = calibrate(replace(machine, joint_tolerance_mm=0.1), on_jig)
    assert (tolerant.directions_lost, tolerant.directions_regularised) == ((), (RIGID[2],))
    # The common height is as uncertain as the mean of six joints that are each known to the tolerance.
    names = [tolerant.layout.names.index(("base-joints", "", f"joint_{i}_z_mm")) for i in range(1, 7)]
    mean = np.zeros(len(tolerant.x))
    mean[names] = 1.0 / 6.0
    assert np.sqrt(mean @ tolerant.solution.covariance @ mean) == pytest.approx(0.1 / np.sqrt(6), rel=0.1)


@pytest.mark.parametrize("name", ["gravity", "backlash", "servo-lag", "joint-friction", "spindle-growth"])
def test_predicted_is_what_the_virtual_machine_reads_whatever_its_errors(machine, name):
    source = known_sources()[name]
    values = np.array([p.grid[len(p.grid) // 2] if p.grid else p.plausible for p in source.parameters(machine)])
    truth = MachineModel(machine, (*random_kinematics(machine, 3), Fitted(source, values)))
    runs = draw_session(truth, plan("conventional"), np.random.default_rng(4), 0.0, 72, micrometer_mm=0.0)
    first = [run for run in runs if run.raw.circle.direction == "ccw"]  # the ball is put up just before these
    left = [run.raw.length_mm - truth.bar(run.motion()).length_mm for run in first]
    # One length error of the bar, the same everywhere. The two put the ball up some seconds apart.
    assert np.ptp(np.concatenate(left)) < (3e-5 if name == "spindle-growth" else 1e-6)


@pytest.mark.parametrize("name", ["base-joints", "gravity", "servo-lag", "tool-ball-offset"])
def test_derivatives_of_a_reading_about_a_ball_put_up_under_the_spindle(machine, under_spindle, name):
    source = known_sources()[name]
    motion = under_spindle[2].motion()
    count = len(source.parameters(machine))
    zero = np.zeros(count)
    shared = source.shared_by(motion)
    analytic = MachineModel(machine).bar(motion).by_source(source, machine, zero)
    for k, parameter in enumerate(source.parameters(machine)):
        step = 0.02 * parameter.plausible * np.eye(count)[k]
        up, down = (MachineModel(machine, (Fitted(source, s * step, shared),)).bar(motion).length_mm for s in (1, -1))
        numeric = (up - down) / (2.0 * step[k])
        assert analytic[:, k] == pytest.approx(numeric, abs=1e-4 * max(np.abs(numeric).max(), 1e-6))
