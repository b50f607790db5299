"""The virtual instrument alone: bytes and times as a real one would send them."""

from __future__ import annotations

import statistics
import time
from itertools import pairwise
from typing import TYPE_CHECKING

import pytest
import serial

from dbbstation.instrument.codec import decode
from dbbstation.instrument.driver import Instrument
from dbbstation.instrument.library import load_instrument
from dbbstation.virtual.wire import VirtualInstrument
from dbbstation.virtual.wire_clock import PacedClock, ScaledClock
from tests.instrument.leaks import nothing_left_open
from tests.virtual.clocks import HandClock, LeapingClock

if TYPE_CHECKING:
    from dbbstation.instrument.protocol import Protocol

__all__ = ["nothing_left_open"]

ND = load_instrument("heidenhain-nd281b")
ENCODER = load_instrument("streaming-encoder")
LINES = pytest.mark.parametrize("pty", [True, False], ids=["pty", "socket"])


@LINES
def test_the_display_answers_byte_for_byte(pty: bool) -> None:  # noqa: FBT001 (a parameter of the test)
    with (
        VirtualInstrument(ND, lambda _: -5.23, pty=pty) as virtual,
        serial.serial_for_url(virtual.port, 9600, timeout=1) as port,
    ):
        for _ in range(2):
            port.write(b"\x02")
            assert port.read(17) == b"-    5.2300    \r\n"
        port.timeout = 0.05
        assert port.read(1) == b""
        port.write(b"hello")
        assert port.read(1) == b""
    assert virtual.unknown_bytes == 5


def test_the_display_takes_its_time() -> None:
    """Request 1.1458 ms, latency 51 ms, then 17 characters of 1.1458 ms."""
    clock = HandClock()
    with (
        VirtualInstrument(ND, lambda _: 150.0, clock=clock) as virtual,
        serial.Serial(virtual.port, 9600, timeout=1) as port,
    ):
        port.write(b"\x02")
        give_up_s = time.monotonic() + 10.0
        while not virtual._outgoing and time.monotonic() < give_up_s:
            time.sleep(0.001)
        came = b""
        for now_s, characters in ((0.0532, 0), (0.0534, 1), (0.0631, 9), (0.0716, 16), (0.0718, 17)):
            clock.now_s = now_s
            came += port.read(characters - len(came))
            assert len(came) == characters
            port.timeout = 0.03
            assert port.read(1) == b""
            port.timeout = 1
    assert came == b"+  150.0000    \r\n"


def test_fourteen_readings_per_second_at_9600_baud() -> None:
    """The request and the 17 characters of its answer have 11 bits each, the display takes 51 ms between them."""
    clock = LeapingClock()
    with (
        VirtualInstrument(ND, lambda _: 150.0, clock=clock) as virtual,
        Instrument(ND, virtual.port, clock=clock) as driver,
    ):
        times_s = [reading.t_s for reading in driver.readings(41)]
    assert 40 / (times_s[-1] - times_s[0]) == pytest.approx(1.0 / (0.051 + 18 * 11 / 9600), rel=1e-4)


@pytest.mark.parametrize("scale", [1.0, 10.0])
def test_no_faster_than_the_line_on_scaled_time(scale: float) -> None:
    clock = ScaledClock(scale)
    with (
        VirtualInstrument(ND, lambda t_s: 100.0 + t_s, clock=clock) as virtual,
        Instrument(ND, virtual.port, clock=clock) as driver,
    ):
        taken_s = [reading.length_mm for reading in driver.readings(1 + round(10 * min(scale, 4)))]
    # How much slower is up to the computer.
    assert all(later - earlier > 1.0 / 14.0 for earlier, later in pairwise(taken_s))


@LINES
def test_the_stream_loses_nothing(pty: bool) -> None:  # noqa: FBT001 (a parameter of the test)
    clock = ScaledClock(10)
    # The length tells by the instrument's clock when it was taken, whenever the computer gets round to reading it.
    with (
        VirtualInstrument(ENCODER, lambda t_s: 100.0 + t_s, clock=clock, pty=pty) as virtual,
        Instrument(ENCODER, virtual.port, clock=clock) as driver,
    ):
        readings = list(driver.readings(2500))
    assert driver.tally.lost == driver.tally.garbage_bytes == 0
    assert [one.length_mm - readings[0].length_mm for one in readings] == pytest.approx(
        [n / 250.0 for n in range(2500)], abs=2e-5
    )
    assert [(one.counter - readings[0].counter) % 100_000 for one in readings] == list(range(2500))


@pytest.mark.parametrize(("paced", "falls_behind"), [(PacedClock, False), (ScaledClock, True)])
def test_a_machine_slower_than_its_pace_is_late_and_not_wrong(*, paced: type[ScaledClock], falls_behind: bool) -> None:
    """Each length takes 2 ms to compute, but 250 a second at ten times real time leave 0.4 ms."""

    def length_mm_at(t_s: float) -> float:
        time.sleep(0.002)
        return 100.0 + t_s

    clock = paced(10.0)
    with (
        VirtualInstrument(ENCODER, length_mm_at, clock=clock) as virtual,
        Instrument(ENCODER, virtual.port, clock=clock, timeout_s=60.0) as driver,
    ):
        readings = list(driver.readings(600))
        behind_s = clock() - (readings[-1].length_mm - 100.0)
    assert driver.tally.lost == 0
    taken_s = [one.length_mm - readings[0].length_mm for one in readings]
    assert taken_s == pytest.approx([n / 250.0 for n in range(600)], abs=2e-5)
    assert (behind_s > 2.0) is falls_behind


@LINES
def test_a_program_that_reads_late_gets_every_sample(pty: bool) -> None:  # noqa: FBT001 (a parameter of the test)
    """6000 samples come due while nobody reads, more than line and instrument keep; they come later, at their own times."""
    clock = HandClock()
    with (
        VirtualInstrument(ENCODER, lambda t_s: 100.0 + t_s, clock=clock, pty=pty) as virtual,
        serial.serial_for_url(virtual.port, 115200, timeout=5) as port,
    ):
        first = decode(ENCODER, next_line(port, clock))
        clock.now_s += 24.0
        time.sleep(0.2)
        came = [decode(ENCODER, port.readline()) for _ in range(5900)]
    assert [(one.counter - first.counter) % 100_000 for one in came] == list(range(1, 5901))
    assert [one.length_mm - first.length_mm for one in came] == pytest.approx(
        [n / 250.0 for n in range(1, 5901)], abs=2e-5
    )


def next_line(port: serial.SerialBase, clock: HandClock) -> bytes:
    port.timeout = 0.05
    give_up_s = time.monotonic() + 10.0
    raw = b""
    while not raw.endswith(b"\n") and time.monotonic() < give_up_s:
        clock.now_s += 0.001
        raw += port.readline()
    port.timeout = 5
    return raw


@pytest.mark.parametrize(("protocol", "tolerance_s"), [(ND, 0.02), (ENCODER, 0.01)], ids=["display", "encoder"])
def test_samples_are_stamped_when_they_were_taken(protocol: Protocol, tolerance_s: float) -> None:
    # The display's reply ends 70 ms after it took the length.
    clock = ScaledClock()
    with (
        VirtualInstrument(protocol, lambda t_s: 100.0 + t_s, clock=clock) as virtual,
        Instrument(protocol, virtual.port, clock=clock) as driver,
    ):
        late_s = [one.t_s - (one.length_mm - 100.0) for one in driver.readings(15)]
    assert abs(statistics.median(late_s)) < tolerance_s


def test_nobody_listening_is_no_backlog() -> None:
    clock = ScaledClock()
    with VirtualInstrument(ENCODER, lambda t_s: t_s, clock=clock) as virtual:
        for _ in range(2):
            time.sleep(0.1)
            opened_s = clock()
            with Instrument(ENCODER, virtual.port, clock=clock) as driver:
                assert driver.read().length_mm > opened_s - 0.01
                assert driver.tally.lost == 0


def test_other_baud_rates_are_other_speeds() -> None:
    assert ND.fastest_hz(1200) < ND.fastest_hz() < ND.fastest_hz(38400) < 20
    with (
        VirtualInstrument(ENCODER, lambda t_s: 100.0 + t_s, baud=9600) as virtual,
        Instrument(ENCODER, virtual.port, baud=9600) as driver,
    ):
        taken_s = [reading.length_mm for reading in driver.readings(20)]
    # 26 characters of 10 bits: the line carries 36.9 lines per second, not 250.
    assert 19 / (taken_s[-1] - taken_s[0]) == pytest.approx(9600 / 260, rel=1e-3)


def test_an_error_in_the_length_comes_out() -> None:
    def broken(_t_s: float) -> float:
        raise ZeroDivisionError("no length")

    virtual = VirtualInstrument(ND, broken)
    virtual.start()
    with serial.Serial(virtual.port, 9600, timeout=0.1) as port:
        port.write(b"\x02")
        port.read(1)
    with pytest.raises(ZeroDivisionError, match="no length"):
        virtual.stop()


def test_it_can_be_switched_on_again() -> None:
    virtual = VirtualInstrument(ND, lambda _: 150.0)
    for _ in range(2):
        with virtual, serial.Serial(virtual.port, 9600, timeout=1) as port:
            port.write(b"\x02")
            assert decode(ND, port.read(17)).length_mm == 150.0


def test_nothing_listens_beyond_this_computer() -> None:
    with VirtualInstrument(ND, lambda _: 150.0, pty=False) as virtual:
        assert virtual.port.startswith("socket://127.0.0.1:")


def test_a_time_scale_is_positive() -> None:
    with pytest.raises(ValueError, match="above 0"):
        ScaledClock(0.0)
