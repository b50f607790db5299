"""Every fault of a line, on a real pseudo-terminal, is told apart with its cause and a remedy."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import pytest

from dbbstation.errors import InstrumentError
from dbbstation.instrument.driver import Instrument
from dbbstation.instrument.library import load_instrument
from dbbstation.virtual.wire_clock import ScaledClock
from tests.virtual.faulty import FaultyInstrument as VirtualInstrument

if TYPE_CHECKING:
    from dbbstation.instrument.protocol import Protocol

ND = load_instrument("heidenhain-nd281b")
ENCODER = load_instrument("streaming-encoder")
BOTH = pytest.mark.parametrize("protocol", [ND, ENCODER], ids=lambda protocol: protocol.name)
PATIENCE_S = 0.15


def steady(_t_s: float) -> float:
    return 150.0003


def until_the_end(instrument: Instrument) -> None:
    for _ in instrument.readings():
        pass


def until_one_is_lost(instrument: Instrument) -> set[float | None]:
    lengths_mm = set()
    for reading in instrument.readings(2000):
        lengths_mm.add(reading.length_mm)
        if reading.lost:
            return lengths_mm
    raise AssertionError("no sample was lost")


@BOTH
def test_silent_from_the_start(protocol: Protocol) -> None:
    with VirtualInstrument(protocol, steady) as virtual:
        virtual.go_silent()
        with (
            Instrument(protocol, virtual.port, timeout_s=PATIENCE_S) as instrument,
            pytest.raises(InstrumentError) as caught,
        ):
            until_the_end(instrument)
    assert caught.value.where == virtual.port
    assert "the instrument is silent" in caught.value.what
    assert "is it switched on, is the cable" in caught.value.remedy
    assert str(protocol.line.baud) in caught.value.remedy


@BOTH
def test_fallen_silent_in_mid_run(protocol: Protocol) -> None:
    with (
        VirtualInstrument(protocol, steady, clock=ScaledClock(5)) as virtual,
        Instrument(protocol, virtual.port, timeout_s=2 * PATIENCE_S) as instrument,
    ):
        assert list(instrument.readings(3))
        virtual.go_silent()
        with pytest.raises(InstrumentError, match="fell silent"):
            until_the_end(instrument)


def test_wrong_baud_rate_of_a_display_that_is_asked_is_silence() -> None:
    # The display hears garbage instead of its request, and says nothing.
    with VirtualInstrument(ND, steady, baud=19200) as virtual:
        with (
            Instrument(ND, virtual.port, timeout_s=PATIENCE_S) as instrument,
            pytest.raises(InstrumentError, match=r"silent: no answer to the request 02 .* can also be set to .*19200"),
        ):
            until_the_end(instrument)
        time.sleep(0.01)
        assert virtual.unknown_bytes > 0


@pytest.mark.parametrize("baud", [57600, 230400])
def test_wrong_baud_rate_of_a_stream_is_garbage(baud: int) -> None:
    with (
        VirtualInstrument(ENCODER, steady, baud=baud) as virtual,
        Instrument(ENCODER, virtual.port, timeout_s=PATIENCE_S) as instrument,
        pytest.raises(InstrumentError) as caught,
    ):
        until_the_end(instrument)
    assert "what comes is not streaming-encoder (profile crc): " in caught.value.what
    assert "most likely the baud rate: the port uses 115200" in caught.value.remedy
    assert str(baud) in caught.value.remedy


@BOTH
def test_the_right_baud_rate_is_understood(protocol: Protocol) -> None:
    with (
        VirtualInstrument(protocol, steady, baud=38400) as virtual,
        Instrument(protocol, virtual.port, baud=38400) as instrument,
    ):
        assert instrument.read().length_mm == 150.0003


@BOTH
def test_parity_in_the_eighth_bit_is_named(protocol: Protocol) -> None:
    with VirtualInstrument(protocol, steady) as virtual:
        virtual.show_parity()
        with (
            Instrument(protocol, virtual.port, timeout_s=PATIENCE_S) as instrument,
            pytest.raises(
                InstrumentError,
                match="without the highest bit it is a reading, and that bit is even parity: set data bits and parity",
            ),
        ):
            until_the_end(instrument)


@BOTH
def test_half_a_line_then_silence(protocol: Protocol) -> None:
    with (
        VirtualInstrument(protocol, steady, clock=ScaledClock(5)) as virtual,
        Instrument(protocol, virtual.port, timeout_s=2 * PATIENCE_S) as instrument,
    ):
        assert list(instrument.readings(3))
        virtual.cut_next_frame(9, then_silent=True)
        with pytest.raises(InstrumentError) as caught:
            until_the_end(instrument)
    assert "only part of a reply came" in caught.value.what
    assert " = '" in caught.value.what  # the bytes, in hexadecimal and as text
    assert "2b" in caught.value.what


@BOTH
def test_half_a_line_is_one_sample_lost(protocol: Protocol) -> None:
    with (
        VirtualInstrument(protocol, steady, clock=ScaledClock(5)) as virtual,
        Instrument(protocol, virtual.port) as instrument,
    ):
        list(instrument.readings(3))
        virtual.cut_next_frame(9)
        assert until_one_is_lost(instrument) == {150.0003}
        assert instrument.tally.garbage_bytes >= 9


@BOTH
def test_noise_in_mid_run_is_counted_and_survived(protocol: Protocol) -> None:
    with (
        VirtualInstrument(protocol, steady, clock=ScaledClock(5)) as virtual,
        Instrument(protocol, virtual.port) as instrument,
    ):
        list(instrument.readings(3))
        lengths_mm = set()
        while not instrument.tally.lost:  # noise that falls behind a reply, before the next request, costs nothing
            virtual.send_garbage(b"\xfe\x80\x00")
            lengths_mm |= {reading.length_mm for reading in instrument.readings(2)}
        assert lengths_mm == {150.0003}
        assert instrument.tally.garbage_bytes >= 3


@BOTH
@pytest.mark.parametrize("pty", [True, False], ids=["pty", "socket"])
def test_line_closed_in_mid_run(protocol: Protocol, pty: bool) -> None:  # noqa: FBT001 (a parameter of the test)
    with (
        VirtualInstrument(protocol, steady, clock=ScaledClock(5), pty=pty) as virtual,
        Instrument(protocol, virtual.port, timeout_s=2.0) as instrument,
    ):
        assert list(instrument.readings(3))
        virtual.hang_up()
        with pytest.raises(
            InstrumentError, match="the line was closed while it was in use; plug the instrument in again"
        ):
            until_the_end(instrument)


@BOTH
def test_a_fault_of_the_device_is_a_reading_without_length(protocol: Protocol) -> None:
    with VirtualInstrument(protocol, lambda _: None) as virtual, Instrument(protocol, virtual.port) as instrument:
        reading = instrument.read()
        assert (reading.length_mm, reading.status) == (None, "fault")
        assert reading.said
        assert reading.remedy


def test_a_length_beyond_the_range_is_overrange() -> None:
    with VirtualInstrument(ENCODER, lambda _: 1e5) as virtual, Instrument(ENCODER, virtual.port) as instrument:
        reading = instrument.read()
        assert reading.status == "overrange"
        assert reading.said == "the encoder is at the end of its travel"
        assert reading.remedy.startswith("bring the balls")


def test_lost_samples_are_counted() -> None:
    with VirtualInstrument(ENCODER, steady) as virtual, Instrument(ENCODER, virtual.port) as instrument:
        list(instrument.readings(5))
        virtual.drop_samples(7)
        until_one_is_lost(instrument)
        assert instrument.tally.lost == 7


def test_an_instrument_switched_off_and_on_is_noticed() -> None:
    with VirtualInstrument(ENCODER, steady, pty=False) as virtual, Instrument(ENCODER, virtual.port) as instrument:
        list(instrument.readings(5))
        virtual._counter = 0
        with pytest.raises(InstrumentError, match="the sample counter went from"):
            until_the_end(instrument)
