"""Circles in both directions, nominal and compensated, run through the machine with its errors; all fifteen are nightly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.circle_program import arc_phi_deg, chord_error_mm, circle_toolpath
from dbbstation.nc.circle_programs import circle_programs
from dbbstation.nc.compensate import Prefer
from dbbstation.nc.export import Inverse
from dbbstation.nc.toolpath import RowKind, Toolpath, in_pieces
from dbbstation.plan.plan import Circle, Direction
from dbbstation.sources.contract import Motion
from tests.nc.whole import compensate_toolpath


def reached(model: MachineModel, poses: np.ndarray) -> np.ndarray:
    return model.actual_poses(Motion(poses=poses, is_path=True))


@pytest.fixture(
    scope="module",
    params=[pytest.param("bo", marks=pytest.mark.slow), pytest.param("abcdefghijklmno", marks=pytest.mark.nightly)],
    ids=["two", "fifteen"],
)
def compensated(request, linuxcnc, table2, crooked) -> dict[str, Toolpath]:
    """Read back from the text: what the control will really be told."""
    programs = circle_programs(table2, crooked.machine, linuxcnc, inverse=Inverse(crooked), tests=list(request.param))
    assert len(programs) == 2 * len(request.param)
    return {program.file: linuxcnc.read(program.text, program.file) for program in programs}


def off_the_circle_mm(poses: np.ndarray, circle: Circle) -> tuple[np.ndarray, np.ndarray]:
    from_centre = poses[:, :3] - circle.centre_mm
    return np.hypot(from_centre[:, 0], from_centre[:, 1]) - circle.radius_mm, from_centre[:, 2]


def test_programs_take_the_machine_to_the_nominal_circles(compensated, table2, crooked):
    worst_mm = worst_deg = before_mm = 0.0
    for name, path in compensated.items():
        test, direction = name.removesuffix(".ngc").split("-")
        circle = table2.tests[test].run(Direction(direction))
        wanted = circle.poses(circle.theta_deg(arc_phi_deg(circle, 0.1)))
        # The move down to the first point may be in pieces.
        arc = path.poses[path.kind == RowKind.FEED][-len(wanted) - 1 : -1]
        off = reached(crooked, arc) - wanted
        worst_mm = max(worst_mm, np.linalg.norm(off[:, :3], axis=1).max())
        worst_deg = max(worst_deg, np.abs(off[:, 3:]).max())
        before_mm = max(before_mm, np.linalg.norm((reached(crooked, wanted) - wanted)[:, :3], axis=1).max())
    assert before_mm > 0.1
    assert worst_mm < 0.01e-3
    assert worst_deg < 1e-6


def test_between_the_points_nothing_is_lost_but_the_chord(compensated, table2, crooked):
    for name in (name for name in compensated if name.endswith("-ccw.ngc")):
        circle = table2.tests[name[0]].circle
        path = compensated[name]
        pieces = np.where(path.kind == RowKind.FEED, 4, 1)
        row, share = in_pieces(pieces)
        on_arc = (path.kind[row] == RowKind.FEED) & (np.abs(path.tip_mm[row] - 0.26) < 0.01)
        radial, height = off_the_circle_mm(reached(crooked, path.between(row, share)[on_arc]), circle)
        chord = chord_error_mm(circle, 0.1)
        assert chord == pytest.approx(0.0571e-3, rel=1e-3)
        assert radial.max() < 0.01e-3
        assert radial.min() > -chord - 0.01e-3
        assert np.abs(height).max() < 0.01e-3


def test_feed_in_goes_along_the_bar(compensated, table2, crooked):
    circle = table2.tests["b"].circle
    path = compensated["b-ccw.ngc"]
    outside, first = path.poses[path.kind == RowKind.FEED][:2]
    ways = reached(crooked, outside + np.linspace(0.0, 1.0, 7)[:, None] * (first - outside))[:, :3] - circle.ball_mm
    length = np.linalg.norm(ways, axis=1)
    np.testing.assert_allclose(length, np.linspace(circle.bar_mm + circle.feed_in_mm, circle.bar_mm, 7), atol=1e-5)
    np.testing.assert_allclose(ways / length[:, None], np.tile(ways[-1] / length[-1], (7, 1)), atol=1e-7)


def test_a_machine_without_errors_gets_the_nominal_program(linuxcnc, table2, reference):
    perfect = Inverse(MachineModel(reference))
    nominal = circle_programs(table2, reference, linuxcnc, tests=["h"])
    perfect = replace(perfect, prefer=Prefer.POSITION_ONLY)
    same = circle_programs(table2, reference, linuxcnc, inverse=perfect, tests=["h"])
    for program, other in zip(nominal, same, strict=True):
        assert other.greatest_correction_um == pytest.approx(0.0, abs=1e-6)
        there, here = (linuxcnc.read(each.text, each.file) for each in (program, other))
        np.testing.assert_allclose(here.poses[here.is_move], there.poses[there.is_move], rtol=0.0, atol=1.1e-6)


def test_nominal_and_compensated_programs_differ_in_numbers_only(linuxcnc, all_runs, crooked):
    path = circle_toolpath(all_runs[4], "x")
    done = compensate_toolpath(path, crooked, keep_arcs=True).toolpath
    np.testing.assert_array_equal(done.kind, path.kind)
    np.testing.assert_array_equal(done.feed_mm_min, path.feed_mm_min)
    assert done.text == path.text
    assert abs(done.end_s[-1] - path.end_s[-1]) < 0.02
    assert "G64 P0.0001 Q0" in linuxcnc.write(done).splitlines()
