"""Effects on no list: what they follow, on which strut, and how large, from recordings of mechanisms in time."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.diagnosis.diagnose import diagnose
from dbbstation.diagnosis.shapes import PULL, READING, SIGNED, TOOL, Follows
from dbbstation.inference.levels import Verdict
from dbbstation.sources.registry import sources_named
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.mechanisms.oddities import CreepingSpindle, CyclingChiller, RockingTable, SpringyDrive, WindingCable
from tests.plant.mechanisms.outsiders import BuildingSway, DentedScrew, HoseDrag, LobedSocket, SoftFloor
from tests.plant.plan import ALL, EIGHT, subset, table_ii_plan
from tests.plant.session import MEANS_OF_TWO_HZ, record

KINEMATICS = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05)
pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("few_parts")]
NAMES = ("backlash", "bar-drift")


def left(folder, seed, *mechanisms, tests=EIGHT):
    """What has no name in a recording, of which nothing is named."""
    plan = subset(table_ii_plan(seed), tests)
    record(folder, seed=seed, plan=plan, mechanisms=[KINEMATICS, *mechanisms], rate_hz=MEANS_OF_TWO_HZ)
    recorded = load_sessions([folder])
    found = diagnose(recorded.machine, recorded.observations, sources_named(NAMES))
    assert {f.name for f in found.sources if f.verdict is Verdict.IDENTIFIED} == set()
    return found.unexplained


def values_of(curve):
    return np.array([[point.at, point.value_um, point.uncertainty_um] for point in curve.points]).T


def test_a_building_that_sways_is_a_wave_of_time_along_its_direction(tmp_path):
    found = left(tmp_path / "s", 31, BuildingSway(amplitude_um=0.8, period_s=23.0, towards_deg=65.0))
    assert (found.variable, found.strut) == ("time wave of the ball on the table", None)
    assert (found.curve.period, found.curve.unit) == (pytest.approx(23.0, rel=1e-3), "s")
    _, value, sigma = values_of(found.curve)
    assert np.hypot(value.max(), value.min()) / np.sqrt(2) == pytest.approx(0.8, abs=4 * sigma.max())
    assert abs(np.array(found.curve.direction) @ [np.cos(np.radians(65)), np.sin(np.radians(65)), 0]) > 0.95


def test_a_belt_that_gives_way_follows_the_acceleration_of_its_strut(tmp_path):
    found = left(tmp_path / "s", 32, SpringyDrive(strut=4, give_um_s2_m=500.0), tests=ALL)
    assert (found.variable, found.strut, found.curve.unit) == ("strut-acceleration", 4, "mm/s²")
    at, value, sigma = values_of(found.curve)
    # The strut stays behind by 0.5 µm per mm/s².
    assert value == pytest.approx(-0.5 * at, abs=5 * sigma.max() + 0.02 * np.abs(0.5 * at).max())


@pytest.mark.nightly  # waves of time are in CI
def test_a_socket_with_seven_lobes_is_their_wave(tmp_path):
    socket = LobedSocket(amplitude_um=0.3, lobes=7, phase_deg=15.0)
    found = left(tmp_path / "s", 33, socket)
    assert (found.variable, found.strut, found.curve.form) == ("angle wave", None, "7 lobes")
    at, value, sigma = values_of(found.curve)
    assert np.sqrt(np.mean(((value - 0.3 * np.cos(np.radians(7 * at - 15.0))) / sigma) ** 2)) < 2.0


@pytest.mark.nightly  # a wide one is in tests/diagnosis/test_unexplained.py
def test_a_narrow_dent_is_a_bump_of_its_height(tmp_path):
    found = left(tmp_path / "s", 34, DentedScrew(strut=5, at_mm=775.0, width_mm=6.0, height_um=3.0))
    assert (found.variable, found.strut) == ("strut-length bump", 5)
    at, value, _ = values_of(found.curve)
    assert at[value.argmax()] == pytest.approx(775.0, abs=4.0)
    assert value.max() == pytest.approx(3.0, rel=0.35)  # widths are tried in steps of 60 %


@pytest.mark.parametrize(
    ("mechanism", "variable", "strut"),
    [
        (CyclingChiller(strut=6, height_um=1.0, period_s=43.0), "time wave", 6),
        pytest.param(
            RockingTable(tip_um=(3.0, 1.0, 1.0)), "position of the platform step", None, marks=pytest.mark.nightly
        ),
        pytest.param(
            SoftFloor(lean_urad_mm=0.05), "position of the platform of the table", None, marks=pytest.mark.nightly
        ),  # a fainter one is in tests/diagnosis/test_unexplained.py
        (HoseDrag(stiffness_n_mm=1.0), "position of the platform towards a place that pulls on it", None),
        pytest.param(
            CreepingSpindle(runout_um=0.4, share=3.3), "angle since the start", None, marks=pytest.mark.nightly
        ),
        pytest.param(WindingCable(pull_um=1.0), "angle since the start", None, marks=pytest.mark.nightly),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_an_effect_is_put_on_what_it_follows(tmp_path, mechanism, variable, strut):
    found = left(tmp_path / "s", 35, mechanism)
    assert (found.variable[: len(variable)], found.strut) == (variable, strut)
    assert found.curve.strut == strut
    _, value, sigma = values_of(found.curve)
    assert np.abs(value).max() > 3 * np.median(sigma)


@pytest.mark.parametrize(
    "seed", [41, pytest.param(42, marks=pytest.mark.nightly), pytest.param(43, marks=pytest.mark.nightly)]
)
def test_nothing_is_found_where_nothing_is(tmp_path, seed):
    found = left(tmp_path / "s", seed)
    assert (found.variable, found.curve, found.text) == (None, None, "Nothing is left beyond noise.")


@pytest.mark.parametrize(
    ("follows", "printed", "moves_struts"),
    [
        (Follows("strut-length", "", SIGNED), "strut-length by direction of travel", True),
        (Follows("time", "step"), "time step", True),
        (Follows("time", "step", READING), "time step of the reading", False),
        (Follows("angle since the start", "wave", READING), "angle since the start wave of the reading", False),
        (Follows("position of the platform", "", PULL), "position of the platform with a pull on it", False),
        (Follows("tilt of the platform", "", TOOL), "tilt of the platform", False),
    ],
)
def test_what_an_effect_follows_is_printed_and_told_apart(follows, printed, moves_struts):
    assert (str(follows), follows.moves_struts) == (printed, moves_struts)
