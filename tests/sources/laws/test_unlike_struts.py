"""What a strut with a longer or shorter length of its own adds, against the laws' closed forms behind a turning point."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.machine.geometry import Frames
from dbbstation.machine.kinematics import inverse
from dbbstation.sources.causes.backlash import Backlash
from dbbstation.sources.causes.reversal_spike import ReversalSpike
from dbbstation.sources.laws.motion import since_turning
from dbbstation.sources.laws.unlike_struts import HALVES
from tests.sources.runs import run

WIDTH_UM, LENGTH_MM = 5.0, 0.03


def wound_up_um(way_mm, length_mm):
    return -WIDTH_UM * (0.5 - np.exp(-way_mm / length_mm))


def spike_um(way_mm, length_mm):
    risen = 1.0 - np.exp(-way_mm / (1.1e-3 * WIDTH_UM))
    return -WIDTH_UM * risen * np.exp(-np.sqrt(way_mm / length_mm))


def straight(law, way_mm):
    longer, shorter = (law(way_mm, LENGTH_MM * times) for times in (2.0, 0.5))
    return [(longer - shorter) / 2.0]


def several(law, way_mm):
    return [law(way_mm, LENGTH_MM * times) - law(way_mm, LENGTH_MM) for times in (0.5, 0.71, 1.41, 2.0)]


@pytest.mark.parametrize(
    ("source", "law", "changed"),
    [(Backlash().other_laws()[0], wound_up_um, several), (ReversalSpike(), spike_um, straight)],
    ids=["wind-up", "spike"],
)
def test_a_strut_that_needs_another_length_alone(reference, source, law, changed):
    motion = run((100, 100, -1150), (-10, 10), step_deg=0.5)
    travel = inverse(reference.hexapod, Frames.from_poses(motion.poses, reference.hexapod.rotation)).length_mm
    since = since_turning(travel)
    values = np.array([*np.where(np.arange(6) == 2, WIDTH_UM, 0.0), LENGTH_MM])
    every_um = 1e3 * source.left_open(motion, reference, values).strut_mm
    assert not np.delete(every_um, 2, axis=1).any()
    # Turns are many lengths apart. The turning point lies between two rows, some tenths of a micrometre apart: 0.15 µm
    # of 15 µm change 5 µm by 0.05 µm.
    way, sense = np.abs(since[:, 2]), np.sign(since[:, 2])
    turned = sense != 0.0
    assert turned.sum() > 100
    for first, change_um in enumerate(changed(law, way)):
        own_um = every_um[:, 2, 6 * first : 6 * first + 6]
        assert not np.delete(own_um, 2, axis=1).any()
        assert np.allclose(own_um[turned, 2], (sense * change_um)[turned], atol=0.05)
        assert np.abs(own_um[:, 2]).max() > 0.3


def test_wind_ups_over_these_lengths_come_near_one_over_any_length_between():
    way = np.linspace(0.0, 12.0, 4001)
    changes = np.column_stack([np.exp(-way / times) - np.exp(-way) for times in HALVES])
    for times in np.geomspace(0.5, 2.0, 41):
        wanted = np.exp(-way / times) - np.exp(-way)
        found = changes @ np.linalg.lstsq(changes, wanted, rcond=None)[0]
        assert np.allclose(found, wanted, atol=3e-4)


def test_a_strut_that_is_behind_at_once(reference):
    motion = run((100, 100, -1150), (-10, 10), step_deg=0.5)
    travel = inverse(reference.hexapod, Frames.from_poses(motion.poses, reference.hexapod.rotation)).length_mm
    way, sense = np.abs(since_turning(travel)), np.sign(since_turning(travel))
    every = ReversalSpike().left_open(motion, reference, np.array([*[WIDTH_UM] * 6, LENGTH_MM])).strut_mm[:, :, 6:]
    expected = sense * (-WIDTH_UM * np.exp(-np.sqrt(way / LENGTH_MM)) - spike_um(way, LENGTH_MM))
    growing, shrinking = every[:, :, :6], every[:, :, 6:]
    for strut in range(6):
        for columns, own in ((growing, sense > 0.0), (shrinking, sense < 0.0)):
            assert np.allclose(1e3 * columns[:, strut, strut], (expected * own)[:, strut], atol=1e-9)
            assert not np.delete(columns[:, :, strut], strut, axis=1).any()
