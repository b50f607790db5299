"""Sessions of the independent plant, diagnosed by sets of causes: what is hidden is named, and nothing else."""

from __future__ import annotations

import pytest

from studies.diagnosed import diagnose_sessions
from tests.diagnosis import engine_sessions
from tests.diagnosis.engine_sessions import (
    RATE_HZ,
    TESTS,
    answer,
    gravity_backlash_and_screw_cyclic,
    screw_lead_and_gravity,
    screw_wave_under_coloured_noise,
    warm_up_in_two_stages,
    warm_up_in_two_stages_and_warm_frame,
    warm_up_of_unknown_time_constant,
)

pytestmark = pytest.mark.usefixtures("few_parts")

SURE = 0.95
RIVALS = ("screw-lead", "strut-weight", "servo-lag", "joint-friction", "platform-joints")
"""Of gravity, backlash and a screw's cyclic error: what acts over the same lengths, loads and reversals."""


def _diagnosed(recipe, folder, candidates=None):
    truth = recipe(folder)
    return diagnose_sessions([truth.folder], candidates, (), lambda _: None), truth


def _named(summary):
    return {s["name"] for s in summary["sources"] if s["verdict"] == "identified"}


def _doubtful(summary):
    """Causes in doubt that are not just another word for an identified one."""
    named = _named(summary)
    return {
        s["name"] for s in summary["sources"] if s["verdict"] == "ambiguous" and not named & set(s.get("class", ()))
    }


@pytest.mark.nightly  # three causes at once are in CI
def test_a_lead_and_gravity_are_named_though_both_act_over_the_length(tmp_path):
    found, _ = _diagnosed(screw_lead_and_gravity, tmp_path / "s")
    summary = found.summary()
    assert _named(summary) == {"screw-lead", "gravity"}
    assert not _doubtful(summary)
    gravity = next(s for s in summary["sources"] if s["name"] == "gravity")
    # A strut's own weight does the same on these tests, and the answer says so.
    assert "strut-weight" in gravity["class"]
    compliance = gravity["parameters"]["strut_compliance_um_kn"]
    assert abs(compliance["value"] - 4.84) < 3.0 * compliance["uncertainty"]
    for strut, lead in enumerate((40.0, -20.0, 30.0, -40.0, 10.0, -30.0), 1):
        screw = next(s for s in summary["sources"] if s["name"] == "screw-lead")["parameters"][f"strut_{strut}_um_m"]
        assert abs(screw["value"] - lead) < 3.0 * screw["uncertainty"]
    # Noise and uncertainties explain what is left of tests that were left out.
    assert 0.8 < summary["held_out_normalised"]["after"] < 1.3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rivals", "tests", "rate_hz"),
    [(RIVALS, TESTS, 3.0), pytest.param(None, TESTS, RATE_HZ, marks=pytest.mark.nightly)],
    ids=["few", "all"],
)
def test_three_causes_at_once_are_all_named(tmp_path, monkeypatch, rivals, tests, rate_hz):
    """On eight of the tests nothing tells gravity from the struts' own weight."""
    monkeypatch.setattr(engine_sessions, "TESTS", tests)
    monkeypatch.setattr(engine_sessions, "RATE_HZ", rate_hz)
    hidden = {"gravity", "backlash", "screw-cyclic"}
    candidates = None if rivals is None else (*sorted(hidden), *rivals)
    found, _ = _diagnosed(gravity_backlash_and_screw_cyclic, tmp_path / "s", candidates)
    summary = found.summary()
    assert _named(summary) == hidden
    assert not _doubtful(summary)
    assert all(s["probability"] >= SURE for s in summary["sources"] if s["verdict"] == "identified")


@pytest.mark.nightly
def test_a_warm_up_needs_no_second_name_for_its_time_constant(tmp_path):
    found, _ = _diagnosed(warm_up_of_unknown_time_constant, tmp_path / "s")
    assert _named(found.summary()) == {"thermal-struts"}
    assert not _doubtful(found.summary())


@pytest.mark.nightly  # three causes at once are in CI; what follows a thermometer is in tests/diagnosis/test_thermometers.py
def test_a_second_stage_of_a_warm_up_is_no_second_cause(tmp_path):
    found, _ = _diagnosed(warm_up_in_two_stages, tmp_path / "s")
    assert _named(found.summary()) == {"thermal-struts"}
    assert not _doubtful(found.summary())
    assert found.summary()["unexplained"]["text"] == "Nothing is left beyond noise."


@pytest.mark.nightly
def test_a_frame_that_warms_beside_a_warm_up_in_two_stages_is_one(tmp_path):
    found, _ = _diagnosed(warm_up_in_two_stages_and_warm_frame, tmp_path / "s")
    assert _named(found.summary()) == {"thermal-struts", "thermal-frame"}


@pytest.mark.nightly  # a wave is among the three causes and the notebook
def test_a_screw_wave_is_not_taken_for_noise(tmp_path):
    found, truth = _diagnosed(screw_wave_under_coloured_noise, tmp_path / "s")
    summary = found.summary()
    assert _named(summary) == {"screw-cyclic"}
    # Two samples are averaged in each of 720 sectors: the slow noise of their means is less by the root of their number.
    samples = sum(len(o.raw) for o in found.recorded.observations) / len(found.recorded.observations)
    expected_um = answer(truth)["noise_slow_um"] / (samples / 720) ** 0.5
    assert summary["noise_um"] == pytest.approx(expected_um, rel=0.05)
