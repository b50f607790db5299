"""Pushes of one size and of many, what else they may be, and files with zeros of their own."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.diagnosis.drive.findings import CausePart
from dbbstation.diagnosis.drive.identify import identify
from dbbstation.diagnosis.drive.pulses import complement_of, distinct_pushes, equal_pushes
from dbbstation.diagnosis.drive.sources import known_drive_sources
from dbbstation.facts.value import Value
from dbbstation.inference.levels import pooled
from dbbstation.results.drive import drive_result
from dbbstation.trace.drive import DriveRecording
from tests.diagnosis.drive.plant import Truth, record, to_and_fro


def pushes(sizes, sigma=0.2):
    return [CausePart("", (k + 0.2, k + 0.7), {"force_n": Value(size, sigma, "N")}) for k, size in enumerate(sizes)]


def test_pushes_of_one_size_count_once():
    parts = pushes([5.0, 4.8, -3.0, 5.1, 4.9])
    assert [part.t_s[0] for part in equal_pushes(parts)] == [0.2, 1.2, 3.2, 4.2]
    assert distinct_pushes(parts) == 2
    assert distinct_pushes(pushes([2.0 * k for k in range(1, 11)])) == 10
    assert distinct_pushes([]) == 0
    # Neighbours that agree in pairs are not of one size together.
    assert distinct_pushes(pushes([0.4 * k for k in range(1, 21)])) > 15
    # 25 of 5 N, each known to 0.3 N.
    assert distinct_pushes(pushes(5.0 + 0.3 * np.random.default_rng(1).standard_normal(25), 0.3)) <= 2


def test_the_pooled_size_is_the_weighted_mean():
    found = pooled([Value(4.0, 0.1, "N"), Value(4.3, 0.2, "N")])
    # Weights 100 and 25: 4.06; scatter 100 * 0.0036 + 25 * 0.0576 = 1.8, root of 1.8 / 125.
    assert found.value == pytest.approx(4.06)
    assert found.uncertainty == pytest.approx(0.12)


def test_the_complement_of_pulses_is_the_opposite_force_in_between():
    found = complement_of(pushes([5.0, 5.0, 5.0]), 0.0, 4.0)
    assert found.force_n.value == pytest.approx(-5.0)
    assert found.t_s == ((0.0, 0.2), (0.7, 1.2), (1.7, 2.2), (2.7, 4.0))
    assert complement_of(pushes([5.0]), 0.0, 4.0) is None


def test_a_file_with_a_zero_of_its_own_is_told():
    made = []
    for seed, zero in ((1, 0.0), (2, 0.0), (3, 6.0)):
        t, position, force = record(Truth(coulomb=20.0), to_and_fro(seconds=8.0), seed)
        made.append(DriveRecording(f"file {seed}", t, position, force + zero))
    summary = drive_result(identify(made, list(known_drive_sources().values()))).to_dict()
    effects = {effect["text"]: effect for effect in summary["unexplained"]["effects"]}
    assert list(effects) == ["offset of file 3"]
    # 6 N in a third of the samples; mass and viscous friction take none of it.
    assert effects["offset of file 3"]["rms_n"] == pytest.approx(6.0 / np.sqrt(3.0), rel=0.05)
    assert {s["name"] for s in summary["sources"] if s["verdict"] in {"identified", "happened"}} == {"coulomb-friction"}
