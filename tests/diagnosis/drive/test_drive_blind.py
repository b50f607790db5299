"""Drawn drives: what is said of them is there, and intervals hold the truth.

Run by hand: `pytest -m nightly tests/diagnosis/drive/test_drive_blind.py`, some minutes.
"""

from __future__ import annotations

import pytest

from tests.diagnosis.drive.blind import study


@pytest.mark.nightly
def test_drawn_drives_are_named_for_what_they_have():
    figures = study(count=40, seed=20261122)
    assert figures["wrong"] <= 0.07 * figures["said"]
    assert figures["named"] >= 0.8 * figures["causes"]
    assert figures["within_2u"] >= 0.9 * figures["values"]
