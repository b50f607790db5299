"""What a strut with a longer or shorter length of its own adds, against the laws' closed forms behind a turning point."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.machine.kinematics import inverse
from dbbstation.machine.rotation import Frames
from dbbstation.sources.causes.backlash import Backlash
from dbbstation.sources.causes.reversal_spike import ReversalSpike
from dbbstation.sources.laws.turning import since_turning
from tests.sources.runs import run

WIDTH_UM, LENGTH_MM = 5.0, 0.03


def wound_up_um(way_mm, length_mm):
    return -WIDTH_UM * (0.5 - np.exp(-way_mm / length_mm))


def spike_um(way_mm, length_mm):
    risen = 1.0 - np.exp(-way_mm / (1.1e-3 * WIDTH_UM))
    return -WIDTH_UM * risen * np.exp(-np.sqrt(way_mm / length_mm))


@pytest.mark.parametrize(
    ("source", "law"),
    [(Backlash().other_laws()[0], wound_up_um), (ReversalSpike(), spike_um)],
    ids=["wind-up", "spike"],
)
def test_a_strut_that_needs_another_length_alone(reference, source, law):
    motion = run((100, 100, -1150), (-10, 10), step_deg=0.5)
    travel = inverse(reference.hexapod, Frames.from_poses(motion.poses, reference.hexapod.rotation)).length_mm
    since = since_turning(travel)
    values = np.array([*np.where(np.arange(6) == 2, WIDTH_UM, 0.0), LENGTH_MM])
    changes_um = 1e3 * source.left_open(motion, reference, values).strut_mm[:, :, :6]
    assert not np.delete(changes_um[:, 2], 2, axis=1).any()
    assert not np.delete(changes_um, 2, axis=1).any()
    # Turns are many lengths apart. The turning point lies between two rows, some tenths of a micrometre apart.
    way, sense = np.abs(since[:, 2]), np.sign(since[:, 2])
    longer, shorter = (law(way, LENGTH_MM * times) for times in (2.0, 0.5))
    turned = sense != 0.0
    assert turned.sum() > 100
    assert np.allclose(changes_um[turned, 2, 2], (sense * (longer - shorter) / 2.0)[turned], atol=0.03)
    assert np.abs(changes_um[:, 2, 2]).max() > 0.5


def test_a_strut_that_is_behind_at_once(reference):
    motion = run((100, 100, -1150), (-10, 10), step_deg=0.5)
    travel = inverse(reference.hexapod, Frames.from_poses(motion.poses, reference.hexapod.rotation)).length_mm
    way, sense = np.abs(since_turning(travel)), np.sign(since_turning(travel))
    at_once = ReversalSpike().left_open(motion, reference, np.array([*[WIDTH_UM] * 6, LENGTH_MM])).strut_mm[:, :, 6]
    expected = sense * (-WIDTH_UM * np.exp(-np.sqrt(way / LENGTH_MM)) - spike_um(way, LENGTH_MM))
    assert np.allclose(1e3 * at_once, expected, atol=1e-9)
