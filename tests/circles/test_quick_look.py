"""Signatures of serial axes in circles of machines that have one fault of known size: where the axes really stand, exactly."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.circles.analysis import analyse
from dbbstation.circles.quick_look import ENDS, Signature, SignatureColumn, _turn, quick_look, shapes_of
from dbbstation.trace.recording import RawCircle
from tests.circles.test_analysis import CCW, CW, PHI

NOISE_UM = 0.2
COARSE = PHI[::4]


def turn(fault, circle, rng, noise_um=NOISE_UM, phi=PHI):
    """What a bar reads of a machine whose axes stand off their commands; `fault` takes X, Y and their speeds [mm, mm/s]."""
    theta = np.radians(circle.theta_deg(phi))
    radius, turning = circle.radius_mm, circle.direction.sign * np.radians(circle.turning_deg_s)
    x, y = radius * np.cos(theta), radius * np.sin(theta)
    off_x, off_y = fault(x, y, -turning * y, turning * x)
    length = np.hypot(x + off_x, y + off_y) + 1e-3 * noise_um * rng.normal(size=len(x))
    return analyse(RawCircle("a run", circle, phi / circle.turning_deg_s, phi, length))


def look(fault, seed=0, circles=(CCW, CW), **options):
    rng = np.random.default_rng(seed)
    return quick_look([turn(fault, circle, rng, **options) for circle in circles])


def seen_of(found):
    return {(one.signature, one.place) for one in found.symptoms if one.seen}


def size_of(found, signature, place=""):
    return next(one for one in found.symptoms if (one.signature, one.place) == (signature, place))


def none(x, _y, _vx, _vy):
    return np.zeros_like(x), np.zeros_like(x)


def out_of_square(_x, y, _vx, _vy):
    """Y leans by 50 µm/m towards -X: the axes include more than a right angle."""
    return -50e-6 * y, np.zeros_like(y)


def scaled(x, y, _vx, _vy):
    """X goes 30 µm/m too far, Y 10 µm/m."""
    return 30e-6 * x, 10e-6 * y


def lagging(_x, _y, vx, vy):
    """X follows 2.5 ms behind its command, Y 2 ms."""
    return -2.5e-3 * vx, -2.0e-3 * vy


def with_play(x, _y, vx, _vy):
    """X has 4 µm of play: it stands 2 µm behind wherever it goes."""
    return -2e-3 * np.sign(vx), np.zeros_like(x)


def with_uneven_play(x, y, _vx, vy):
    """Y has 6 µm of play at its upper end, 2 µm at its lower, evenly between."""
    play = 1e-3 * (4.0 + 2.0 * y / 150.0)
    return np.zeros_like(x), -0.5 * play * np.sign(vy)


def sticking(x, y, vx, _vy):
    """Y holds on for 6 degrees behind its upper end: half a sine of 3 µm outwards."""
    behind = np.degrees(np.arctan2(x, y)) * np.sign(vx)
    spike = np.where((y > 0) & (behind > 0) & (behind < 6.0), 3e-3 * np.sin(np.pi * behind / 6.0), 0.0)
    return np.zeros_like(x), spike


def spiked(heights_um, length_deg):
    """Each axis sticks behind both its ends: half a sine outwards, of a height for each end."""

    def fault(x, y, vx, vy):
        off = np.zeros((2, len(x)))
        for end, height in heights_um.items():
            side, axis = (1.0 if end[0] == "+" else -1.0), "XY".index(end[1])
            along, across, speed = (x, y, vy) if axis == 0 else (y, x, vx)
            behind = np.degrees(np.arctan2(across * np.sign(speed), side * along))
            on = (side * along > 0) & (behind > 0) & (behind < length_deg)
            off[axis] += side * np.where(on, 1e-3 * height * np.sin(np.pi * behind / length_deg), 0.0)
        return tuple(off)

    return fault


def cyclic(x, _y, _vx, _vy):
    """X goes 0.5 µm to and fro every 12 mm, as a bent screw of that pitch would."""
    return 0.5e-3 * np.sin(2 * np.pi * x / 12.0 + 0.7), np.zeros_like(x)


SINGLE = [
    (out_of_square, Signature.SQUARENESS, {"": 50.0}),
    (scaled, Signature.SCALE, {"": 20.0}),
    (lagging, Signature.SERVO, {"": 0.5}),
    (with_play, Signature.BACKLASH, {"+X": 4.0, "-X": 4.0}),
    (with_uneven_play, Signature.BACKLASH, {"+Y": 6.0, "-Y": 2.0}),
    (sticking, Signature.SPIKE, {"+Y": 3.0}),
    (cyclic, Signature.CYCLIC, {"X": 0.5}),
]


@pytest.mark.parametrize(("fault", "signature", "sizes"), SINGLE)
def test_a_fault_shows_its_size_and_nothing_else(fault, signature, sizes):
    found = look(fault)
    assert seen_of(found) == {(signature, place) for place in sizes}
    for place, size in sizes.items():
        one = size_of(found, signature, place)
        assert abs(one.value - size) < 4.0 * one.u
        assert one.u < 0.05 * size
    assert found.left_rms_um == pytest.approx(NOISE_UM, rel=0.1)


def test_all_of_them_at_once():
    faults = (out_of_square, scaled, lagging, with_play, with_uneven_play, cyclic)

    def together(*where):
        return tuple(np.sum([fault(*where) for fault in faults], axis=0))

    found = look(together)
    for fault, signature, sizes in SINGLE:
        for place, size in sizes.items() if fault in faults else ():
            one = size_of(found, signature, place)
            assert one.seen
            assert abs(one.value - size) < 5.0 * one.u, (signature, place, one)


def test_a_sound_machine_shows_nothing():
    """Twelve looks; by chance one in 580 shows something."""
    assert [seen_of(look(none, seed, phi=COARSE)) for seed in range(12)] == [set()] * 12


def test_uncertainties_are_what_figures_scatter_by():
    """Mean square of (value - truth) / u over twenty looks: one, within four standard errors."""
    truth = {(Signature.SQUARENESS, ""): 50.0}
    pulls = [
        (one.value - truth.get((one.signature, one.place), 0.0)) / one.u
        for seed in range(20)
        for one in look(out_of_square, seed, phi=COARSE).symptoms
        if one.signature not in {Signature.CYCLIC, Signature.SPIKE}
    ]
    assert abs(np.mean(np.square(pulls)) - 1.0) < 4.0 * np.sqrt(2.0 / len(pulls))


def test_uncertainties_of_spikes_hold_that_their_length_is_not_known():
    """Sound machines, and such with spikes about as high as their uncertainty, of any length: the length that leaves least, taken
    as known, gives 1.5, beyond three standard errors."""
    pulls = []
    for seed in range(24):
        rng = np.random.default_rng(1000 + seed)
        heights = dict(zip(("+X", "-X", "+Y", "-Y"), (seed % 2) * rng.normal(0.0, 0.1, 4), strict=True))
        found = look(spiked(heights, rng.choice([1.8, 3.0, 4.2, 7.2])), seed, phi=COARSE)
        pulls += [
            (one.value - heights[one.place]) / one.u for one in found.symptoms if one.signature is Signature.SPIKE
        ]
    assert 0.5 < np.mean(np.square(pulls)) < 1.0 + 3.0 * np.sqrt(2.0 / len(pulls))


@pytest.mark.parametrize("lobes", [3, 4, 5, 8])
def test_a_form_that_both_directions_share_is_no_signature(lobes):
    """What the geometry of any machine may do; a reading along the bar of 10 µm."""

    def form(x, y, _vx, _vy):
        theta = np.arctan2(y, x)
        size = 10e-3 * np.cos(lobes * theta + 0.3)
        return size * np.cos(theta), size * np.sin(theta)

    assert seen_of(look(form)) == set()


def test_a_form_that_turns_with_the_direction_makes_figures_uncertain():
    """Three lobes that change sign with the sense of travel, as struts that reverse elsewhere have: no shape here is that."""

    def form(x, y, vx, vy):
        theta = np.arctan2(y, x)
        size = 3e-3 * np.cos(3 * theta) * np.sign(vy * x - vx * y)
        return size * np.cos(theta), size * np.sin(theta)

    calm, stirred = (size_of(look(fault), Signature.SERVO) for fault in (none, form))
    assert stirred.u > 5.0 * calm.u


def test_one_direction_does_not_tell_squareness_from_lag():
    found = look(lagging, circles=(CW,))
    for signature in (Signature.SQUARENESS, Signature.SERVO):
        one = size_of(found, signature)
        assert (one.value, one.u, one.seen) == (None, None, False)
        assert "one direction" in one.text
    played = size_of(look(with_play, circles=(CW,)), Signature.BACKLASH, "+X")
    assert abs(played.value - 4.0) < 4.0 * played.u


def test_many_samples_are_averaged_and_few_refused():
    """At 1 kHz a turn has 57 000 samples: the figures are those of all of them."""
    found = look(cyclic, phi=np.arange(0.0, 360.0, 360.0 / 57000))
    one = size_of(found, Signature.CYCLIC, "X")
    assert one.seen
    assert one.value == pytest.approx(0.5, abs=4.0 * one.u)
    assert one.u < 0.005
    assert "12.0 mm" in one.text
    assert look(none, phi=np.arange(0.0, 360.0, 2.0)) is None


def test_averages_of_samples_lie_at_their_angles_about_a_ball_beside_the_centre():
    """Each average is of twenty samples, with the mean arctangent of their coordinates."""
    phi = np.arange(57600) / 160.0
    theta = np.radians(CCW.theta_deg(phi))
    x, y = CCW.radius_mm * np.cos(theta) - 3.0, CCW.radius_mm * np.sin(theta) + 2.0
    averages = _turn(analyse(RawCircle("a run", CCW, phi / CCW.turning_deg_s, phi, np.hypot(x, y))))
    angle = np.degrees(np.unwrap(np.arctan2(y, x)).reshape(-1, 20).mean(axis=1))
    far = np.abs(np.mod(averages.theta_deg[:, None] - angle + 180.0, 360.0) - 180.0).min(axis=1)
    assert len(far) > 2800
    assert far.max() < 1e-3


@pytest.mark.parametrize("circle", [CCW, CW])
@pytest.mark.parametrize("end", ENDS)
def test_the_shape_of_a_spike_is_that_of_an_axis_that_sticks_behind_its_end(end, circle):
    theta = np.radians(circle.theta_deg(PHI))
    x, y, sign = np.cos(theta), np.sin(theta), circle.direction.sign
    off_x, off_y = spiked({end: 1.0}, 6.0)(x, y, -sign * y, sign * x)
    shape = shapes_of(np.degrees(theta), circle, 6.0)[SignatureColumn(Signature.SPIKE, end, "µm")]
    # The axis is up to 6 degrees off its own direction there, whose cosine is 0.9945.
    assert shape == pytest.approx(1e3 * (off_x * x + off_y * y), abs=0.006)
