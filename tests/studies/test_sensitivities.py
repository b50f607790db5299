"""The study of constants: another value holds wherever the constant is used, and only for one answer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import studies.sensitivities as asked
from dbbstation.diagnosis.drive import channel, fit, identify
from studies.commands.sensitivities import sensitivities
from studies.sensitivities import Answer, Constant, Variation, answer_to, study

SHARE = Constant("diagnosis.drive.channel", "METHOD_SHARE")
DRIVE = Path("drive.csv")
USAGE = 2


@pytest.fixture
def answers(monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, float, float]]:
    seen: list[tuple[float, float, float]] = []

    def answer(_: Variation) -> Answer:
        seen.append((channel.METHOD_SHARE, identify.METHOD_SHARE, fit.LIKELY))
        share = 1e3 * channel.METHOD_SHARE
        return Answer({"play": "identified" if share < 3.0 else "ambiguous"}, {"mass_kg": (10.0 + share, 0.5)})

    monkeypatch.setattr(asked, "_drive_answer", answer)
    return seen


def test_another_value_holds_for_one_answer_and_no_other_constant(answers):
    own, other = channel.METHOD_SHARE, fit.LIKELY
    answer_to(Variation(SHARE, 0.5, (DRIVE,)))
    answer_to(Variation(None, 0.0, (DRIVE,)))
    assert answers == [(0.5, 0.5, other), (own, own, other)]


def test_what_changes_is_said_in_verdicts_and_uncertainties(answers, monkeypatch):
    monkeypatch.setattr(asked, "DRIVE", (SHARE,))
    half, twice = study([(DRIVE, None)], [], 1)
    assert len(answers) == 3
    assert (half.tried, twice.tried) == (0.5 * half.own, 2.0 * half.own)
    assert half.verdicts == ()
    assert twice.verdicts == ("play: identified -> ambiguous",)
    # From 12 to 11 and to 14 kg, with 0.5 kg.
    assert (half.largest, twice.largest) == (pytest.approx(2.0), pytest.approx(4.0))
    assert twice.parameter == "mass_kg"


def test_only_what_is_asked_for_is_varied(answers, monkeypatch):
    monkeypatch.setattr(asked, "DRIVE", (SHARE, Constant("diagnosis.drive.pulses", "APART")))
    found = study([(DRIVE, None)], [], 1, only=["METHOD_SHARE"])
    assert {one.constant for one in found} == {"diagnosis.drive.channel METHOD_SHARE"}
    assert len(answers) == 3


def test_a_constant_that_is_none_of_the_study_is_refused():
    outcome = CliRunner().invoke(sensitivities, [__file__, "--only", "NOTHING"])
    assert outcome.exit_code == USAGE
    assert "NOTHING" in outcome.output
    assert "METHOD_SHARE" in outcome.output


def test_whole_numbers_stay_whole_and_above_zero(monkeypatch):
    assert Constant("diagnosis.drive.channel", "STRONGEST").tried == (3, 12)
    monkeypatch.setattr("dbbstation.diagnosis.drive.channel.STRONGEST", 1)
    assert Constant("diagnosis.drive.channel", "STRONGEST").tried == (1, 2)


def test_a_table_is_asked_by_the_constants_of_mismatch(monkeypatch, tmp_path):
    """A prior of no width keeps a parameter where it is; 0.3 fits."""
    t = np.linspace(0.0, 10.0, 60)
    moves = np.sin(2.0 * t)
    measured = 0.3 * moves + np.random.default_rng(4).normal(0.0, 0.05, len(t))
    rows = [f"{a:.4f},{b:.6f},0,{c:.6f}" for a, b, c in zip(t, measured, moves, strict=True)]
    path = tmp_path / "swing.csv"
    path.write_text("\n".join(["t_s,measured_mm,simulated_mm,d_size", *rows]) + "\n", encoding="utf-8")
    monkeypatch.setattr(asked, "TABLE", (Constant("diagnosis.table.data", "REFITTED", (1e-3,)),))
    (narrow,) = study([], [], 1, tables=[(path, "measured_mm", "simulated_mm")])
    assert narrow.data == "swing"
    assert narrow.parameter == "size"
    assert narrow.largest > 10.0
