"""The flagship study: figures that the papers and independent computations say must come out."""

from __future__ import annotations

import pytest

from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from studies import concealed_gravity
from studies.concealed_figure import concealed_figure
from tests.once import STUDIES, computed_once


@pytest.fixture(scope="module")
def study(reference, tmp_path_factory):
    plans = shipped_folder("protocols") / "plans"
    jig, conditions = read_plan(plans / "table2.yaml"), read_plan(plans / "gravity-conditions.yaml")
    with pytest.MonkeyPatch.context() as patch:
        computed_once(tmp_path_factory, patch, *STUDIES)
        return concealed_gravity.concealed_gravity(reference, jig, conditions, seed=1, progress=lambda _: None)


@pytest.mark.slow
def test_nine_tenths_are_swallowed_and_a_few_micrometres_remain(study):
    """15.1 µm rms leave 4.5, 91 % of the sum of squares: two independent programs found that for this machine."""
    numbers = study.numbers
    assert numbers["concealed"] == pytest.approx(0.91, abs=0.02)
    assert numbers["signature_um"] == pytest.approx(15.1, abs=0.6)
    assert numbers["unconcealed_um"] == pytest.approx(4.5, abs=0.4)
    assert 2.0 < numbers["residual_um"]["kinematic"] < 5.0


def test_it_is_named_with_its_size(study):
    assert study.numbers["verdict"] == "identified"
    compliance = study.numbers["compliance_um_kn"]
    assert abs(compliance["found"] - compliance["true"]) < 4 * compliance["uncertainty"]


def test_joints_were_pulled_by_tenths_of_a_millimetre(study):
    assert 50 < study.numbers["base_joint_shift_um"]["greatest"] < 500


def test_the_tilted_circle_is_wrong_by_tens_of_micrometres_until_gravity_is_modelled(study):
    """Median 52 µm of circularity in condition A after a kinematic jig calibration; joint fits leave the noise."""
    tilted = study.numbers["tilted_circle"]
    assert 30 < tilted["kinematic calibration"]["circularity_um"] < 80
    assert tilted["kinematics and gravity together"]["circularity_um"] < 1.0
    assert tilted["kinematics and gravity together"]["centre_deviation_um"] < 5.0


def test_left_out_tests_are_predicted_to_noise(study):
    held_out = study.numbers["held_out_um"]
    assert held_out["joint"] < 0.6
    assert held_out["kinematic"] > 3.0


def test_the_figure_is_a_picture_and_the_same_every_time(study):
    picture = concealed_figure(study)
    assert picture.startswith(b"<?xml")
    assert picture.rstrip().endswith(b"</svg>")
    assert concealed_figure(study) == picture
    assert b"pulled by" in picture
