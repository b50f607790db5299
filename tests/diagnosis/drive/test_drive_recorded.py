"""Real drives that others recorded, with what is known of each; and one of them with forces left out on purpose.

Sources: the EMPS benchmark of Janot, Gautier and Brunot (2019); its variant of forgi86/sysid-neural-continuous; lead screw of
RViMLab/TRO2021-Dynamic-Modelling; motor of heitor-andrade/laas_anti_cogging; damper of ARTS-Laboratory. Not in the repository.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from dbbstation.diagnosis.drive.identify import identify
from dbbstation.diagnosis.drive.sources import known_drive_sources
from dbbstation.files.recordings.drive_csv import read_drive
from dbbstation.results.drive import drive_result
from dbbstation.trace.drive import DriveRecording

pytestmark = pytest.mark.slow

HIDDEN_N, HIDDEN_S = 5.0, 0.5
"""Pulses that were subtracted from the known force of the EMPS drive: so high, so long, one a second, first at 0.344 s."""


@cache
def answered(path, force_per_ampere=None, cutoff_hz=None):
    recording = read_drive(path).recording(force_per_ampere)
    return drive_result(identify([recording], list(known_drive_sources().values()), cutoff_hz)).to_dict()


@pytest.fixture
def recorded(recordings):
    def path_of(name):
        path = recordings / "real" / name
        if not path.exists():
            pytest.skip(f"{name} is not in DBBSTATION_RECORDINGS")
        return path

    return path_of


def sources(summary):
    return {source["name"]: source for source in summary["sources"]}


@pytest.mark.nightly
def test_25_pulses_that_were_left_out_are_found_with_their_times(recorded):
    summary = answered(recorded("drives/emps-pulses-left-out.csv"))
    transient = sources(summary)["transient-force"]
    assert transient["verdict"] == "happened"
    # Constant load and pulses on half of the time: which half is the pulse, nothing recorded says.
    edges = np.sort([edge for part in transient["parts"] for edge in part["t_s"]])
    true = 0.344 + np.arange(25)
    near = [np.abs(edges - t).min() < 0.03 for t in true[1:]]
    assert np.mean(near) > 0.8
    sizes = [abs(part["parameters"]["force_n"]["value"]) for part in transient["parts"]]
    assert np.median(sizes) == pytest.approx(HIDDEN_N, abs=0.7)
    assert sources(summary)["coulomb-friction"]["parameters"]["coulomb_n"]["value"] == pytest.approx(20.4, rel=0.1)
    mass = summary["parameters"]["mass_kg"]
    assert mass["value"] == pytest.approx(95.1, abs=1.0)


@pytest.mark.nightly  # a force that jumps in a simulated drive is in CI: test_drive_known.py
@pytest.mark.parametrize("starts", [(11.0,), (4.2, 11.0, 20.3)], ids=["one", "three"])
def test_pulses_taken_out_of_the_known_force_are_found(recorded, starts):
    raw = read_drive(recorded("emps/emps.csv")).recording()
    force = raw.force_n.copy()
    for start in starts:
        force -= 10.0 * ((raw.t_s >= start) & (raw.t_s < start + 0.4))
    left_out = DriveRecording("emps less pulses", raw.t_s, raw.position_mm, force)
    transient = sources(drive_result(identify([left_out], list(known_drive_sources().values()))).to_dict())[
        "transient-force"
    ]
    assert transient["verdict"] == "happened"
    for start in starts:
        part = min(transient["parts"], key=lambda one: abs(one["t_s"][0] - start))
        assert part["t_s"] == pytest.approx([start, start + 0.4], abs=0.03)
        value = part["parameters"]["force_n"]
        assert abs(value["value"] + 10.0) < max(3.0 * value["uncertainty"], 1.0)


def test_a_motor_that_is_off_before_and_after_is_no_dead_channel(recorded):
    summary = answered(recorded("drives/lead-screw-start-stop.csv"))
    assert any("rests" in note for note in summary["notes"])
    assert not summary["parameters"]["viscous_n_s_m"]["identifiable"]
    text = " ".join(summary["cannot_tell"])
    # 9.1 N and 231 N·s/m at 6.67 mm/s.
    assert "cannot be distinguished at one speed" in text
    assert float(text.split("mm/s, ")[1].split(" ")[0]) == pytest.approx(9.1 + 231.0 * 0.00667, abs=1.0)


def test_at_one_speed_coulomb_friction_is_not_ruled_out(recorded):
    summary = answered(recorded("drives/lead-screw-start-stop-trimmed.csv"), cutoff_hz=4.0)
    assert sources(summary)["coulomb-friction"]["verdict"] != "ruled-out"
    # Nine stretches of time have fewer independent samples than noise may have: they happened, or cannot be told from noise.
    assert sources(summary)["transient-force"]["verdict"] in {"ambiguous", "happened"}
    assert not summary["parameters"]["viscous_n_s_m"]["identifiable"]


def test_friction_at_32_speeds(recorded):
    """The force that its authors read at each of the speeds, half the difference of both directions, against the law that is named.

    A line alone through them is 9.1 N and 231 N·s/m and 0.4 N off; with Stribeck friction 0.1 N off: 7.35 N, 570 N·s/m, and 2.7 N that
    decay over 1.5 mm/s.
    """
    summary = answered(recorded("drives/lead-screw-32-speeds.csv"))
    found = sources(summary)
    assert found["coulomb-friction"]["verdict"] == "identified"
    stribeck = found["stribeck-friction"]
    assert stribeck["verdict"] in {"identified", "ambiguous"}
    rpm, force = np.loadtxt(recorded("drives/lead-screw-friction-map.csv"), delimiter=",", skiprows=1).T
    speed = np.abs(rpm[rpm > 0.0]) * 2e-3 / 60.0
    read = 0.5 * (force[rpm > 0.0] - force[rpm < 0.0][::-1])
    law = found["coulomb-friction"]["parameters"]["coulomb_n"]["value"]
    law = law + summary["parameters"]["viscous_n_s_m"]["value"] * speed
    excess, decay = (stribeck["parameters"][name]["value"] for name in ("static_excess_n", "stribeck_speed_m_s"))
    law = law + excess * np.exp(-speed / decay)
    assert np.sqrt(np.mean((law - read) ** 2)) < 0.25
    assert abs(excess - 2.7) < 3.0 * stribeck["parameters"]["static_excess_n"]["uncertainty"]
    # What is no pulse is not said to be one for tens of seconds.
    assert all(part["t_s"][1] - part["t_s"][0] < 2.0 for part in found["transient-force"]["parts"])


def test_a_motor_to_and_fro(recorded):
    summary = answered(recorded("drives/motor-to-and-fro.csv"), force_per_ampere=10.0)
    found = sources(summary)
    coulomb = found["coulomb-friction"]
    assert coulomb["verdict"] != "ruled-out"
    # A pulse of one sample is no push.
    assert found["transient-force"]["verdict"] == "ambiguous"
    # What is ambiguous by itself is told and is not predicted with.
    steps = [step["added"] for step in summary["held_back"]["steps"][1:]]
    assert all(found[name]["verdict"] in {"identified", "happened"} or found[name]["ambiguous_with"] for name in steps)
    assert not set(steps) & set(summary["held_back"]["not_in_model"])
    error = summary["held_back"]["relative_force_error"]
    assert error["after"] < error["before"]
    viscous = summary["parameters"]["viscous_n_s_m"]
    assert not viscous["identifiable"] or abs(viscous["value"] - 1.2) < 3.0 * viscous["uncertainty"]
    if coulomb["verdict"] == "identified":
        number = coulomb["parameters"]["coulomb_n"]
        # Where viscous friction is left out as impossible, this is the friction at the speeds that it travels at, up to 0.26 m/s.
        viscous_n = 1.2 * 0.26 if viscous["value"] is None else 0.0
        reach = 3.0 * number["uncertainty"]
        assert 0.81 - reach < number["value"] < 0.81 + viscous_n + reach


@pytest.mark.nightly  # a motor, a screw and a drive that others recorded are in CI
def test_a_damper_with_play_is_not_taken_for_a_wrong_sign(recorded):
    summary = answered(recorded("drives/friction-damper.csv"))
    found = sources(summary)
    assert found["coulomb-friction"]["verdict"] == "identified"
    assert {found[name]["verdict"] for name in ("lost-motion", "presliding")} & {"identified", "ambiguous"}
    # So many pushes of so many sizes are a law that is wrong.
    assert found["transient-force"]["verdict"] == "ambiguous"
    assert found["transient-force"]["parts"] == []
    for side in summary["friction"].values():
        assert side["coulomb_n"]["value"] == pytest.approx(9400.0, rel=0.15)
