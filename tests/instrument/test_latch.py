"""The moment of a length that was asked for, and its uncertainty; and when the first byte of a sample came."""

from __future__ import annotations

from math import sqrt
from statistics import median

import numpy as np
import pytest

from dbbstation.instrument.driver import Arrivals, Instrument
from dbbstation.instrument.library import load_instrument
from dbbstation.instrument.polling import latch_of
from dbbstation.virtual.wire import VirtualInstrument
from dbbstation.virtual.wire_clock import ScaledClock

ND = load_instrument("heidenhain-nd281b")
GAUGE = load_instrument("sylvac-opto-rs")
CHARACTER_S = 11 / 9600
"""Start bit, 7 data bits, parity, 2 stop bits at 9600 baud."""


def test_between_the_bounds_of_the_manual_it_is_the_middle_with_the_width_over_the_root_of_twelve() -> None:
    """Stored at most 1 ms after STX, the reply 51 ms after it at the latest."""
    replied_s = CHARACTER_S + 0.051 + CHARACTER_S
    latch = latch_of(ND, asked_s=0.0, first_byte_s=replied_s, baud=9600)
    assert latch.t_s == pytest.approx(CHARACTER_S + 0.0005)
    assert latch.uncertainty_s == pytest.approx(0.001 / sqrt(12))


def test_a_device_that_is_polled_takes_it_anywhere_before_it_replies() -> None:
    character_s = 11 / 4800
    sent_s = 2 * character_s
    latch = latch_of(GAUGE, asked_s=0.0, first_byte_s=sent_s + 0.04 + character_s, baud=4800)
    assert latch.t_s == pytest.approx(sent_s + 0.02)
    assert latch.uncertainty_s == pytest.approx(0.04 / sqrt(12))


def test_a_reply_that_came_before_its_line_could_carry_it_says_no_more_than_its_own_time() -> None:
    """The line is faster than stated: a rectangle from asking to the first byte, not a moment that is known exactly."""
    latch = latch_of(GAUGE, asked_s=1.0, first_byte_s=1.002, baud=4800)
    assert latch.t_s == pytest.approx(1.001)
    assert latch.uncertainty_s == pytest.approx(0.002 / sqrt(12))


def test_a_reply_that_was_held_up_makes_it_less_certain() -> None:
    """30 ms too late: the request may have left so much later. Rectangle from 0 to 31 ms about an estimate at 0.5 ms."""
    late_s = CHARACTER_S + 0.051 + 0.030 + CHARACTER_S
    latch = latch_of(ND, asked_s=0.0, first_byte_s=late_s, baud=9600)
    assert latch.t_s == pytest.approx(CHARACTER_S + 0.0005)
    moments_s = np.linspace(0.0, 0.031, 100_001)
    assert latch.uncertainty_s == pytest.approx(np.sqrt(np.mean((moments_s - 0.0005) ** 2)), rel=1e-4)


def test_the_uncertainty_holds_what_the_virtual_gauge_does() -> None:
    """A gauge takes its length anywhere before it replies; a bar that moves 1 mm/s tells when that was.

    Of 40 readings the mean of squares over the uncertainty is 1, give or take 4 standard deviations of a mean of rectangular
    squares, sqrt(4/5/40); what the computer holds up makes the stated uncertainty larger and the ratio smaller.
    """
    clock = ScaledClock(3.0)
    with (
        VirtualInstrument(GAUGE, lambda t_s: 100.0 + t_s, clock=clock, seed=5) as virtual,
        Instrument(GAUGE, virtual.port, clock=clock) as instrument,
    ):
        readings = list(instrument.readings(40))
    off_s = np.array([one.t_s - ((one.length_mm or 0.0) - 100.0) for one in readings])
    stated_s = np.array([one.t_uncertainty_s for one in readings], dtype=float)
    assert np.all(stated_s > 0.02)
    assert np.all(np.abs(off_s) < 0.6 * sqrt(12) * stated_s)
    assert np.mean((off_s / stated_s) ** 2) < 1.0 + 4.0 * sqrt(4 / 5 / 40)
    assert all(one.first_byte_s > one.t_s for one in readings)


def test_bytes_seen_together_came_one_after_the_other() -> None:
    arrivals = Arrivals(0.001, reach=100)
    arrivals.note(10, 1.0)
    arrivals.note(5, 2.0)
    assert arrivals.at_latest_s(0) == 2.0
    assert arrivals.at_latest_s(4) == pytest.approx(1.996)
    assert arrivals.at_latest_s(5) == 1.0
    assert arrivals.at_latest_s(14) == pytest.approx(0.991)


def test_arrivals_forget_what_no_frame_reaches() -> None:
    arrivals = Arrivals(0.0, reach=50)
    for place in range(10_000):
        arrivals.note(1, float(place))
    assert len(arrivals._chunks) <= 52


def test_the_first_byte_of_a_sample_of_a_stream_lies_before_it_was_seen_whole() -> None:
    protocol = load_instrument("streaming-encoder")
    with VirtualInstrument(protocol, lambda _: 150.0) as virtual, Instrument(protocol, virtual.port) as instrument:
        readings = list(instrument.readings(50))
    length_s = protocol.frame_characters * 10 / 115_200
    # From one sample to the next it may jump where the computer was busy; over all of them it is the device's period.
    assert (readings[-1].first_byte_s - readings[0].first_byte_s) / 49 == pytest.approx(0.004, rel=0.25)
    # The device's clock is read off what arrives: where the computer held up the first samples, some are stamped by as much too late.
    behind_s = [one.first_byte_s - one.t_s for one in readings]
    assert max(map(abs, behind_s)) < 0.2
    assert -length_s < median(behind_s) < 0.2
    assert {one.t_uncertainty_s for one in readings} == {None}
