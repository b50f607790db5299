"""Where a circle should lie: on machines that are moved as rigid bodies, by plane geometry."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.machine.geometry import Frames
from dbbstation.machine.kinematics import strut_lengths
from dbbstation.model.expected import SECTORS, expected_circle
from dbbstation.model.identified import IdentifiedModel
from dbbstation.model.machine_model import MachineModel
from dbbstation.model.observation import Observation
from dbbstation.plan.plan import Circle, Direction
from dbbstation.sources.contract import Effect, Fitted, LinearSource, Need, Owner, Parameter, Setup, Texts
from dbbstation.sources.registry import known_sources
from dbbstation.trace.expected import LOCAL_COEFFICIENTS
from dbbstation.trace.recording import RawCircle

KNOWN = known_sources()


def observed(elevation_deg: float, direction: Direction) -> Observation:
    place = (20.0, -30.0, -1008.0)
    centre = (*place[:2], place[2] + 150.0 * float(np.sin(np.radians(elevation_deg))))
    circle = Circle(place, centre, 150, (0, 0, 0), 1000, 40.0, 45, 1.5, elevation_deg, direction)
    phi_deg = (np.arange(SECTORS) + 0.5) * 360.0 / SECTORS
    raw = RawCircle("", circle, phi_deg / circle.turning_deg_s, phi_deg, np.full(SECTORS, circle.bar_mm))
    return Observation("a", 1, raw, Setup("s", "m", "b", "i", np.array(place), 0.0, 0.0, 0.0), started_s=0.0)


@pytest.mark.parametrize("direction", list(Direction))
@pytest.mark.parametrize("elevation_deg", [0.0, 50.0])
def test_all_base_joints_moved_move_the_circle(reference, elevation_deg: float, direction: Direction) -> None:
    """Base joints that stand by a vector elsewhere take the platform with them; a raised bar sees it by cos e, and says so."""
    moved = np.tile([0.08, -0.05, 0.0], 6)
    model = MachineModel(reference, (Fitted(KNOWN["base-joints"], moved),))
    expected = expected_circle(observed(elevation_deg, direction), model, [])
    assert expected.centre_mm == pytest.approx([0.08, -0.05], abs=1e-4)  # (0.09 mm)² / 300 mm is the second order
    assert expected.radial_mm == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("elevation_deg", [0.0, 50.0])
def test_all_base_joints_raised_are_read_by_the_sine_of_the_bar(reference, elevation_deg: float) -> None:
    model = MachineModel(reference, (Fitted(KNOWN["base-joints"], np.tile([0.0, 0.0, 0.1], 6)),))
    expected = expected_circle(observed(elevation_deg, Direction.CCW), model, [])
    assert expected.centre_mm == pytest.approx([0.0, 0.0], abs=1e-6)
    assert expected.radial_mm == pytest.approx(0.1 * np.sin(np.radians(elevation_deg)), abs=1e-4)


def test_struts_reverse_where_their_lengths_are_longest_and_shortest(reference) -> None:
    """Against lengths at every hundredth of a degree: as many reversals, each within half a step of a quarter degree."""
    observation = observed(0.0, Direction.CCW)
    stated = expected_circle(observation, MachineModel(reference), []).reversals_deg
    fine_deg = np.arange(0.0, 360.0, 0.01)
    length_mm = strut_lengths(
        reference.hexapod, Frames.from_poses(observation.raw.circle.poses(fine_deg), reference.hexapod.rotation)
    )
    grows = np.diff(length_mm, axis=0, append=length_mm[:1]) > 0.0
    true = [fine_deg[k] for strut in grows.T for k in np.flatnonzero(strut != np.roll(strut, 1))]
    assert len(stated) == len(true) >= 12
    assert np.sort(stated) == pytest.approx(np.sort(true), abs=0.26)


def test_a_shifted_machine_has_a_first_harmonic_counted_from_the_start(reference) -> None:
    """By plane geometry the bar reads dx cos(theta) + dy sin(theta); over sqrt(2) cos and sqrt(2) sin of the angle from the start."""
    dx_um, dy_um, start = 80.0, -50.0, np.radians(40.0)
    moved = np.tile([1e-3 * dx_um, 1e-3 * dy_um, 0.0], 6)
    model = MachineModel(reference, (Fitted(KNOWN["base-joints"], moved),))
    along = dx_um * np.cos(start) + dy_um * np.sin(start)
    across = dy_um * np.cos(start) - dx_um * np.sin(start)
    expected = np.array([0.0, along, 0.0, 0.0, across, 0.0, 0.0]) / np.sqrt(2.0)
    assert expected_circle(observed(0.0, Direction.CCW), model, []).form_um == pytest.approx(expected, abs=0.05)


class Lobed(LinearSource):
    """A bar that reads a wave of five undulations too long, along a way only."""

    name = "lobed"
    belongs_to = Owner.MACHINE
    needs = frozenset({Need.POSE, Need.PATH})
    texts = Texts("", "", "", "", "", "")

    def parameters(self, machine):  # noqa: ARG002
        return (Parameter("size_mm", "mm", 0.004, ""),)

    def derivative(self, motion, machine, values):  # noqa: ARG002
        x, y = (motion.poses[:, :2] - motion.setup.fixed_ball_mm[:2]).T
        return Effect(reading_mm=np.cos(5.0 * np.arctan2(y, x))[:, None])


def test_a_cause_along_the_way_has_its_undulations_in_micrometres(reference) -> None:
    """4 µm times cos(5 theta), over sqrt(2) cos(5 theta): the sixth of the coefficients, behind the mean."""
    expected = expected_circle(observed(0.0, Direction.CCW), MachineModel(reference), [Lobed()])
    wave = np.zeros((LOCAL_COEFFICIENTS, 1))
    wave[5] = 4.0 / np.sqrt(2.0)
    assert expected.local_um["lobed", ""] == pytest.approx(wave, abs=1e-6)


@pytest.mark.parametrize("elevation_deg", [0.0, 50.0])
def test_an_uncertain_common_shift_is_that_of_the_centre(reference, elevation_deg: float) -> None:
    """Base joints known but for one common shift along X of 3 µm: the centre's X is as uncertain, nothing else is."""
    source = KNOWN["base-joints"]
    together = np.tile([0.003, 0.0, 0.0], 6)
    rows = tuple((source.name, "", parameter.name) for parameter in source.parameters(reference))
    model = MachineModel(reference, (Fitted(source, np.zeros(18)),))
    known = IdentifiedModel(model, rows, np.outer(together, together))
    expected = expected_circle(observed(elevation_deg, Direction.CCW), known, [])
    assert expected.covariance_mm2 == pytest.approx(np.diag([0.003**2, 0.0, 0.0]), abs=1e-9)
