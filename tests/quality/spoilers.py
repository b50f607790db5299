"""Recordings of circles, spoilt by a known amount."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dbbstation.plan.plan import Circle
from dbbstation.quality.finding import Name
from dbbstation.quality.knowledge import Run
from dbbstation.trace.cut import edges_of, progress_deg
from dbbstation.trace.recording import Recording


def progress(recording: Recording, circle: Circle) -> np.ndarray:
    return progress_deg(recording, circle, edges_of(recording, circle))


def longer(recording: Recording, by_um: np.ndarray) -> Recording:
    return replace(recording, length_mm=recording.length_mm + 1e-3 * by_um)


def lost(recording: Recording, circle: Circle, percent: float) -> Recording:
    phi = progress(recording, circle)
    turn = np.flatnonzero((phi >= 0.0) & (phi < 360.0))
    count = round(percent / 100.0 * len(turn))
    keep = np.ones(len(recording), dtype=bool)
    keep[turn[100 + 2 * np.arange(count)]] = False
    return replace(recording, t_s=recording.t_s[keep], length_mm=recording.length_mm[keep])


def noisy(recording: Recording, _circle: Circle, um: float) -> Recording:
    return longer(recording, np.random.default_rng(7).normal(0.0, um, len(recording)))


def unclosed(recording: Recording, circle: Circle, um: float) -> Recording:
    phi = progress(recording, circle)
    return longer(recording, um * (np.clip((phi - 335.0) / 10.0, 0.0, 1.0) - np.clip((phi - 365.0) / 10.0, 0.0, 1.0)))


def drifting(recording: Recording, circle: Circle, um: float) -> Recording:
    return longer(recording, um * progress(recording, circle) / 360.0)


def bumpy(recording: Recording, circle: Circle, um: float, at_deg: float = 112.0) -> Recording:
    phi = progress(recording, circle)
    place = circle.phi_deg(np.array([at_deg]))[0]
    return longer(recording, um * np.exp(-0.5 * (phi - place) ** 2))


def spiky(recording: Recording, circle: Circle, um: float, at_deg: float = 112.0) -> Recording:
    apart = np.abs(progress(recording, circle) - circle.phi_deg(np.array([at_deg]))[0])
    one = np.zeros(len(recording))
    one[int(np.argmin(apart))] = um
    return longer(recording, one)


def quiet_deg(one: Run) -> float:
    """Angle of a circle that is farthest from reversals of struts, and from the start of the turn."""
    assert one.expected is not None
    theta = np.arange(20.0, 340.0)
    places = np.array(one.expected.reversals_deg)
    away = np.abs(np.mod(theta[:, None] - places + 180.0, 360.0) - 180.0).min(axis=1)
    return float(theta[int(np.argmax(away))])


def mirrored(recording: Recording, circle: Circle, share: float) -> Recording:
    round_the_other_way = turned(recording, circle, np.negative).length_mm
    return replace(recording, length_mm=recording.length_mm + share * (round_the_other_way - recording.length_mm))


def begun_elsewhere(recording: Recording, circle: Circle, by_deg: float) -> Recording:
    """The turn begun at an angle that is not the plan's: its form is found turned by as much."""
    return turned(recording, circle, lambda phi: phi + by_deg)


def turned(recording: Recording, circle: Circle, place: Callable[[np.ndarray], np.ndarray]) -> Recording:
    """The circle's form as it is at other places of it than where the program should be; outside, as at the corner beside it."""
    phi = progress(recording, circle)
    on_path = np.clip(phi, -circle.overshoot_deg, 360.0 + circle.overshoot_deg)
    there = np.interp(np.mod(place(on_path), 360.0), *_turn(recording, phi))
    here = np.interp(np.mod(on_path, 360.0), *_turn(recording, phi))
    return replace(recording, length_mm=recording.length_mm + there - here)


def _turn(recording: Recording, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Form of the turn up to eight undulations: what is mirrored is form, not noise."""
    turn = (phi >= 0.0) & (phi < 360.0)
    orders = np.outer(np.radians(phi[turn]), np.arange(1, 9))
    columns = np.hstack([np.ones((len(orders), 1)), np.cos(orders), np.sin(orders)])
    found, *_ = np.linalg.lstsq(columns, recording.length_mm[turn], rcond=None)
    even = np.linspace(0.0, 360.0, 1441)
    orders = np.outer(np.radians(even), np.arange(1, 9))
    return even, np.hstack([np.ones((len(orders), 1)), np.cos(orders), np.sin(orders)]) @ found


def scaled(recording: Recording, circle: Circle, percent: float) -> Recording:
    """Read by a gauge that counts so much too much from where it was set to the bar's length."""
    return longer(recording, 10.0 * percent * (recording.length_mm - circle.bar_mm))


def coming_twice(recording: Recording, _circle: Circle, times: int = 2) -> Recording:
    return replace(recording, length_mm=recording.length_mm[np.arange(len(recording)) // times * times])


def overridden(recording: Recording, circle: Circle, percent: float) -> Recording:
    """By so much too slow on the first half of the way from feed-in to feed-out and as much too quick on the second."""
    begun_s, ended_s = edges_of(recording, circle)
    half_s, share = 0.5 * (ended_s - begun_s), 0.01 * percent
    late_s = recording.t_s - begun_s
    turning_s = half_s / (1.0 - share)
    path_s = np.where(late_s < turning_s, late_s * (1.0 - share), half_s + (late_s - turning_s) * (1.0 + share))
    path_s = np.where(late_s < 0.0, late_s, np.minimum(path_s, late_s))
    at = np.searchsorted(recording.t_s, begun_s + path_s - 0.5 * float(np.median(np.diff(recording.t_s))))
    return replace(recording, length_mm=recording.length_mm[np.minimum(at, len(recording) - 1)])


def larger(recording: Recording, _circle: Circle, um: float) -> Recording:
    return longer(recording, np.full(len(recording), um))


def at_feed(recording: Recording, circle: Circle, mm_min: float) -> Recording:
    edges = edges_of(recording, circle)
    middle = 0.5 * (edges[0] + edges[1])
    t_s = middle + (recording.t_s - middle) * circle.feed_mm_min / (circle.feed_mm_min + mm_min)
    return replace(recording, t_s=t_s - t_s[0])


def elsewhere(recording: Recording, circle: Circle, um: float) -> Recording:
    """About a ball that stands beside its place, in the direction in which the circle lies off already."""
    theta = np.radians(circle.theta_deg(progress(recording, circle)))
    return longer(recording, um * np.cos(theta - np.pi / 4.0))


def oval(recording: Recording, circle: Circle, um: float) -> Recording:
    phi = np.radians(progress(recording, circle))
    return longer(recording, np.sqrt(2.0) * um * np.cos(2.0 * phi))


SPOILERS: dict[Name, Callable[..., Recording]] = {
    Name.LOST: lost,
    Name.NOISE: noisy,
    Name.CLOSURE: unclosed,
    Name.DRIFT: drifting,
    Name.BUMP: bumpy,
    Name.SPIKE: spiky,
    Name.DIRECTION: mirrored,
    Name.RADIUS: larger,
    Name.FEED: at_feed,
    Name.BORE: elsewhere,
    Name.OTHER_DIRECTION: oval,
    Name.REPEAT: oval,
}
