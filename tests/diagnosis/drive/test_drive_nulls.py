"""Drives in which nothing is missing, under noise that is not white.

Run by hand: `pytest -m nightly tests/diagnosis/drive/test_drive_nulls.py`, some minutes; figures in docs/validation.md.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.diagnosis.drive.nulls import KINDS, forces, study


def test_noises_are_of_their_kinds():
    rng = np.random.default_rng(1)
    alike = {}
    for kind in ("white", "low-passed", "resonant"):
        rows = forces(kind, rng, 8000)
        assert rows.std() == pytest.approx(1.0)
        alike[kind] = float(rows[1:] @ rows[:-1]) / len(rows)
    assert abs(alike["white"]) < 0.05
    assert min(alike["low-passed"], alike["resonant"]) > 0.95


@pytest.mark.nightly
@pytest.mark.parametrize("kind", KINDS)
def test_few_drives_get_a_false_name(kind):
    figures = study(kind, 10, 1)
    assert figures["with_false_names"] <= (4 if kind == "one-way" else 2)
