"""Recordings that cannot tell everything, and recordings that are no good: each is answered, none is guessed at."""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import pytest

from dbbstation.diagnosis.drive.identify import identify
from dbbstation.diagnosis.drive.recordings import recordings_of
from dbbstation.diagnosis.drive.sampling import evenly_sampled
from dbbstation.diagnosis.drive.signals import signals_of
from dbbstation.diagnosis.drive.sources import drive_sources_named, known_drive_sources
from dbbstation.errors import CalibrationError, ModelError
from dbbstation.results.drive import drive_result
from dbbstation.trace.drive import DriveRecording
from tests.diagnosis.drive.plant import Truth, at_constant_speed, record, to_and_fro

DRY = Truth(mass_kg=80.0, viscous=200.0, coulomb=20.0)


@cache
def good():
    return record(DRY, to_and_fro())


def answered(t, position, force, cutoff_hz=None):
    recording = DriveRecording("simulated", t, position, force)
    return drive_result(identify([recording], list(known_drive_sources().values()), cutoff_hz)).to_dict()


def verdicts(summary):
    return {source["name"]: source["verdict"] for source in summary["sources"]}


def test_without_reversals_friction_and_load_are_one_sum():
    summary = answered(*record(DRY, at_constant_speed(0.02, 10.0, wobble=0.8)))
    found = {s["name"]: s for s in summary["sources"]}
    assert found["coulomb-friction"]["verdict"] == found["constant-load"]["verdict"] == "ambiguous"
    assert found["coulomb-friction"]["ambiguous_with"] == ["constant-load"]
    assert found["coulomb-friction"]["parameters"]["coulomb_n"]["value"] == pytest.approx(20.0, abs=0.1)
    assert summary["friction"] == {}
    assert any("never reverses" in sentence for sentence in summary["cannot_tell"])
    # Speed and acceleration still vary.
    for name, true in (("mass_kg", 80.0), ("viscous_n_s_m", 200.0)):
        number = summary["parameters"][name]
        assert number["identifiable"]
        assert abs(number["value"] - true) < 3.0 * number["uncertainty"]


def test_one_constant_speed_gives_one_force_and_no_mass():
    summary = answered(*record(DRY, at_constant_speed(0.02, 10.0)))
    assert not summary["parameters"]["mass_kg"]["identifiable"]
    assert not summary["parameters"]["viscous_n_s_m"]["identifiable"]
    assert verdicts(summary)["coulomb-friction"] == "not-testable"
    text = " ".join(summary["cannot_tell"])
    assert "The mass cannot be determined" in text
    # 20 N and 200 N·s/m at 20 mm/s.
    force = float(re.search(r"their sum at 20 mm/s, ([\d.]+) ±", text)[1])
    assert force == pytest.approx(24.0, abs=0.05)
    assert "Record at several speeds" in text


def test_a_force_channel_that_is_dead_is_refused():
    t, position, force = good()
    with pytest.raises(
        CalibrationError, match=r"the force is 3 N in every sample: the channel is dead; check the wire"
    ):
        answered(t, position, np.full_like(force, 3.0))


def test_a_channel_that_dies_on_the_way_is_used_as_far_as_it_lived():
    t, position, force = good()
    summary = answered(t, position, np.where((t > 5.0) & (t < 9.0), force[5000], force))
    assert any("the force is dead" in note and "5.000 to 8.999 s" in note for note in summary["notes"])
    assert verdicts(summary)["coulomb-friction"] == "identified"
    mass = summary["parameters"]["mass_kg"]
    assert abs(mass["value"] - 80.0) < 3.0 * mass["uncertainty"]


def test_saturated_samples_are_left_out_and_told():
    t, position, force = good()
    summary = answered(t, position, np.clip(force, -60.0, 60.0))
    assert any("saturated: it stands at its extreme, 60 N" in note for note in summary["notes"])
    mass = summary["parameters"]["mass_kg"]
    assert abs(mass["value"] - 80.0) < 3.0 * mass["uncertainty"]
    # Most of the accelerations are gone with the saturated samples; what moves beside them is compared still.
    good_mass = answered(t, position, force)["parameters"]["mass_kg"]
    assert mass["uncertainty"] > 2.0 * good_mass["uncertainty"]
    with pytest.raises(CalibrationError, match=r"stuck in .* % of the samples"):
        answered(t, position, np.clip(force, -20.0, 20.0))


def test_a_force_with_the_wrong_sign_is_refused():
    t, position, force = good()
    with pytest.raises(CalibrationError, match=r"wrong sign: it acts against the motion.* change the sign"):
        answered(t, position, -force)


@pytest.mark.parametrize(("seconds", "said"), [(0.05, "too few"), (0.3, "too short for a cut-off")])
def test_too_short_recordings_are_refused(seconds, said):
    rows = slice(0, int(seconds * 1000))
    t, position, force = good()
    with pytest.raises(CalibrationError, match=said):
        answered(t[rows], position[rows], force[rows])


def test_a_drive_that_stands_still_is_refused():
    t, position, force = good()
    with pytest.raises(CalibrationError, match="the position does not change"):
        answered(t, np.zeros_like(position), force)


def test_a_cutoff_beyond_the_sampling_rate_is_refused():
    with pytest.raises(
        CalibrationError, match="cut-off of 400 Hz does not suit 1000 samples per second; give one up to"
    ):
        answered(*good(), cutoff_hz=400.0)


def test_a_cutoff_may_be_given():
    summary = answered(*good(), cutoff_hz=20.0)
    assert summary["signals"]["cutoff_hz"] == 20.0
    mass = summary["parameters"]["mass_kg"]
    assert abs(mass["value"] - 80.0) < 3.0 * mass["uncertainty"]


def test_jitter_gaps_and_rounded_stamps(rng):
    t, position, force = good()
    jittered, _, notes = evenly_sampled(DriveRecording("x", t + rng.uniform(-2e-4, 2e-4, len(t)), position, force))
    assert "interpolated to even steps" in notes[0]
    assert np.ptp(np.diff(jittered.t_s)) < 1e-9
    # Stamps printed with too few digits are no jitter: 0.75 ms steps on whole milliseconds.
    _, rate_hz, notes = evenly_sampled(DriveRecording("x", np.round(0.75 * t, 3), position, force))
    assert notes == []
    assert rate_hz == pytest.approx(1000 / 0.75, rel=1e-4)
    kept = np.delete(np.arange(len(t)), np.arange(8000, 8300))
    parted, _, notes = evenly_sampled(DriveRecording("x", t[kept], position[kept], force[kept]))
    assert "1 gaps in the time stamps" in notes[0]
    assert len(parted.t_s) == len(t) - 8300


def test_speed_and_acceleration_follow_a_closed_form():
    """A sine of 100 mm and 0.5 Hz: speed and acceleration by hand."""
    t = np.arange(20000) / 1000.0
    w = 2 * np.pi * 0.5
    recording = DriveRecording("sine", t, 100.0 * np.sin(w * t), np.cos(w * t))
    signals = signals_of(recording, 20.0)
    at = signals.kept
    assert signals.speed_m_s[at] == pytest.approx(0.1 * w * np.cos(w * t[at]), abs=1e-4 * 0.1 * w)
    assert signals.acceleration_m_s2[at] == pytest.approx(-0.1 * w**2 * np.sin(w * t[at]), abs=1e-4 * 0.1 * w**2)
    assert t[signals.reversals] == pytest.approx(0.5 + np.arange(20), abs=2e-3)
    travelled = signals.since_reversal_m[1000]
    assert travelled == pytest.approx(0.1, abs=1e-3)


def test_differences_lose_what_a_closed_form_says():
    """Of a sine of 5 Hz at 100 samples a second: 1 - sinc²(w h / 2) of its acceleration."""
    t = np.arange(3000) / 100.0
    w = 2 * np.pi * 5.0
    one = recordings_of([DriveRecording("sine", t, np.sin(w * t), np.cos(w * t))], 15.0)
    exact = 1.0 - (np.sin(w / 200.0) / (w / 200.0)) ** 2
    assert one.lost_share == pytest.approx(exact, rel=0.06)


def test_an_unknown_cause_is_refused_with_its_nearest_name():
    with pytest.raises(ModelError, match="did you mean coulomb-friction"):
        drive_sources_named(["coulomb"])


def test_each_cause_says_what_it_is():
    for name, source in known_drive_sources().items():
        assert name == source.name
        for text in (source.texts.what, source.texts.shows, source.texts.confirm, source.texts.cure):
            assert text.endswith(".")
            assert len(text) > 40
        assert source.texts.equation
        assert source.texts.origin
