"""The moment of a length that was asked for, and its uncertainty."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest

from dbbstation.instrument.driver import Instrument
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
