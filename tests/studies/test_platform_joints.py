"""The hard case in short: what the jig alone hardly shows is certain after the proposed tests, and is then right elsewhere."""

from __future__ import annotations

import pytest

from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from studies.platform_joints import platform_joints


@pytest.mark.nightly  # that a proposed test halves an uncertainty is in CI: tests/cli/test_next_test.py
def test_from_a_faint_sign_to_a_name_that_is_certain(reference):
    jig = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")
    first, *more = platform_joints(reference, jig, 1, 0.005, lambda _: None, most_rounds=1)
    # They are there: a name is right, and so is that these tests cannot tell.
    assert first.verdict in {"identified", "ambiguous", "not-testable"}
    assert first.concealed > 0.98  # 99 %, physics of the fifteen circles
    assert [one.verdict for one in more] == ["identified"]
    assert len(more[0].added) >= 2
    assert more[0].gain > first.gain + 20.0
    assert more[0].held_out[1] == pytest.approx(1.0, abs=0.05)


@pytest.mark.nightly
def test_larger_errors_are_corrected_elsewhere_too(reference):
    jig = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")
    *_, last = platform_joints(reference, jig, 1, 0.02, lambda _: None, most_rounds=2)
    assert last.verdict == "identified"
    assert last.joint_um < 0.5 * last.kinematic_um
    assert last.stated_um < last.kinematic_um
