"""Commanded poses of recorded runs, from the programs that they were made with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import InputError, StationError
from dbbstation.model.observation import Observation
from dbbstation.nc.circle_program import chord_error_mm, circle_toolpath
from dbbstation.nc.circle_programs import circle_programs
from dbbstation.nc.commanded import commanded_poses, poses_at_progress
from dbbstation.nc.export import Inverse
from dbbstation.plan.plan import Circle
from dbbstation.sources.contract import Motion, Setup
from dbbstation.trace.recording import RawCircle


def observed(circle: Circle, samples: int = 1500) -> Observation:
    phi = (np.arange(samples) + 0.37) * 360.0 / samples
    raw = RawCircle("run", circle, phi / circle.turning_deg_s, phi, np.full(samples, circle.bar_mm))
    setup = Setup("s", "m", "b", "bar", np.array(circle.ball_mm), 1e-3, 1e-3, 1e-3)
    return Observation("a", 1, raw, setup)


@pytest.mark.parametrize("step", [10, pytest.param(1, marks=pytest.mark.nightly)])
def test_a_nominal_program_commands_the_nominal_circle(linuxcnc, all_runs, step):
    for circle in all_runs[::step]:
        run = observed(circle)
        text = linuxcnc.write(circle_toolpath(circle, "run"))
        poses = commanded_poses(text, "programs/run.ngc", run)
        assert poses.shape == (len(run.lead_in_deg) + len(run.raw), 6)
        off = poses - run.motion().poses
        # Chords lie up to 0.057 µm inside, and are shorter than the arc by 1.3e-7: 0.08 µm after 225 degrees.
        assert np.linalg.norm(off[:, :3], axis=1).max() < 0.1e-3
        np.testing.assert_array_equal(off[:, 3:], 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("tests", ["o", pytest.param("abcdefghijklmno", marks=pytest.mark.nightly)])
def test_a_compensated_program_commands_what_takes_the_machine_round_the_nominal_circle(
    linuxcnc, table2, crooked, tests
):
    for program in circle_programs(table2, crooked.machine, linuxcnc, inverse=Inverse(crooked), tests=list(tests)):
        name, direction = program.file.removesuffix(".ngc").split("-")
        test = table2.tests[name]
        circle = next(test.run(each) for each in test.directions if each == direction)
        run = replace(observed(circle), commanded=None)
        run = replace(run, commanded=commanded_poses(program.text, program.file, run))
        reached = crooked.actual_poses(run.motion())
        ways = reached[:, :3] - circle.ball_mm
        chord = chord_error_mm(circle, 0.1)
        off = np.linalg.norm(ways, axis=1) - circle.bar_mm
        assert off.max() < 0.02e-3
        assert off.min() > -chord - 0.02e-3
        assert np.abs(reached[:, 3:] - circle.tilt_deg).max() < 1e-5
        # The control holds the feed along what is commanded, which is longer or shorter than the circle by up to a
        # thousandth: so the tool is early or late, by that share of half a turn at its ends.
        along = reached - circle.poses(circle.theta_deg(run.raw.phi_deg))
        assert np.linalg.norm(along[:, :3], axis=1).max() < 1e-3 * 225.0 / 180.0 * np.pi * circle.radius_mm


def test_at_its_points_the_circle_is_met_to_the_rounding(linuxcnc, table2, crooked):
    circle = table2.tests["d"].circle
    (program, _) = circle_programs(table2, crooked.machine, linuxcnc, inverse=Inverse(crooked), tests=["d"])
    path = linuxcnc.read(program.text, program.file)
    arc = np.flatnonzero(np.abs(path.tip_mm - 0.26) < 0.01)
    middle = (path.end_s[arc[0]] - path.duration_s[arc[0]] + path.end_s[arc[-1]]) / 2.0
    phi = 180.0 + (path.end_s[arc] - middle) * circle.turning_deg_s
    inside = (phi >= -circle.overshoot_deg) & (phi <= 405.0)
    poses = poses_at_progress(path, circle, phi[inside])
    off = np.linalg.norm(crooked.actual_poses(Motion(poses=poses))[:, :3] - circle.ball_mm, axis=1) - circle.bar_mm
    assert np.abs(off).max() < 0.02e-3
    assert len(off) > 4490


def test_hand_written_arcs_without_stops_do_as_well(linuxcnc, table2):
    circle = table2.tests["f"].circle
    out, at = (151.5 * np.sqrt(0.5), 150.0 * np.sqrt(0.5))
    text = f"""
    G21 G90
    G0 X{out:.6f} Y{-out:.6f} Z-1008 A0 B0 C0
    G1 X{at:.6f} Y{-at:.6f} F1000
    G3 X{at:.6f} Y{at:.6f} I{-at:.6f} J{at:.6f} P2
    G1 X{out:.6f} Y{out:.6f}
    M2
    """
    phi = np.linspace(-40.0, 400.0, 777)
    poses = poses_at_progress(linuxcnc.read(text, "hand.ngc"), circle, phi)
    off = poses - circle.poses(circle.theta_deg(phi))
    assert np.linalg.norm(off[:, :3], axis=1).max() < 0.2e-3


def test_another_feed_is_told_apart(linuxcnc, table2):
    circle = table2.tests["a"].circle
    fast = linuxcnc.write(circle_toolpath(replace(circle, feed_mm_min=2000.0), "fast"))
    with pytest.raises(InputError, match="takes 35"):
        commanded_poses(fast, "fast.ngc", observed(circle))
    slow = linuxcnc.write(circle_toolpath(replace(circle, feed_mm_min=900.0), "slow"))
    with pytest.raises(InputError, match="off the plan's circle"):
        commanded_poses(slow, "slow.ngc", observed(circle))


def test_the_program_of_another_test_or_direction_is_refused(linuxcnc, table2):
    one, other = table2.tests["a"], table2.tests["b"]
    for wrong in (other.circle, one.run(one.directions[1]), replace(one.circle, tilt_deg=(3.0, 0.0, 0.0))):
        text = linuxcnc.write(circle_toolpath(wrong, "wrong"))
        with pytest.raises(InputError, match=r"w.ngc: it commands .* off the plan's circle"):
            commanded_poses(text, "w.ngc", observed(one.circle))


def test_an_unknown_extension_is_refused(table2):
    with pytest.raises(StationError, match=r"\.ngc \(linuxcnc\)"):
        commanded_poses("", "run.xyz", observed(table2.tests["a"].circle))
