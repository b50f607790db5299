"""A new instrument is one YAML file: kinds that no shipped file has drive driver and virtual instrument alike."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbbstation.instrument.codec import Decoder, Garbage, decode, encode
from dbbstation.instrument.doubt import Piece
from dbbstation.instrument.driver import Instrument
from dbbstation.instrument.library import load_instrument, read_protocol
from dbbstation.virtual.wire import VirtualInstrument
from dbbstation.virtual.wire_clock import ScaledClock
from tests.instrument.scripted_port import expected

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.instrument.protocol import Protocol

# A stream of binary frames with a head, a counter, status bits and a checksum, which must be started and stopped.
BINARY = r"""
format: dbb-instrument/1
name: binary-probe
title: Incremental probe with binary frames
line: {baud: 460800}
ask:
  mode: stream
  start: [{send: "RESET\r", reply: "OK\r", wait_s: 0.01}, {send: "RUN\r", reply: "OK\r"}]
  stop: [{send: "HALT\r"}]
length: {unit: count, mm_per_count: 0.0001, sense: -1, range_mm: [-200, 200]}
frames:
  - parts:
      - {kind: literal, value: "\xAA\x55"}
      - {kind: integer, of: counter, modulus: 256, size: 1}
      - {kind: integer, size: 4, order: little, signed: true}
      - kind: flags
        base: 0x40
        bits:
          - {bit: 0, means: probe not connected, status: fault, remedy: plug the probe in}
          - {bit: 1, means: end of travel, status: overrange, remedy: move back}
      - {kind: checksum, algorithm: crc16-modbus, order: little, after: 2}
timing: {latch_delay_s: 0.0002, rate_hz: 1000, timeout_s: 1}
"""

# Asked with a text command; errors come as other lines; the digits are replaced where there is no value.
TEXT = r"""
format: dbb-instrument/1
name: laser-head
title: Laser displacement head
line: {baud: 38400, parity: odd}
ask: {mode: latch, request: "M1\r"}
length: {unit: um, range_mm: [-10, 10]}
frames:
  - parts:
      - {kind: literal, value: "M1,"}
      - kind: decimal
        max_width: 11
        decimals: 2
        signed: true
        plus: "+"
        specials:
          - {code: "+FFFFFFF", means: too far, status: overrange, remedy: move closer}
          - {code: "-FFFFFFF", means: too close, status: overrange, remedy: move back}
      - {kind: literal, value: ","}
      - {kind: checksum, algorithm: sum8, written: HEX}
      - {kind: literal, value: "\r"}
  - name: error
    status: fault
    means: the head has no measurement
    remedy: look at its lamps
    parts:
      - {kind: literal, value: "ER,"}
      - {kind: skip, written: "00"}
      - {kind: literal, value: "\r"}
timing: {reply_latency_s: 0.002, rate_hz: 200, timeout_s: 0.5}
"""

# Three tagged bytes carry 18 bits: no head, no checksum, the tags alone say where a value starts.
TAGGED = r"""
format: dbb-instrument/1
name: tagged-triangulator
title: Triangulation sensor with tagged bytes
line: {baud: 691200}
ask: {mode: stream}
length: {unit: um, range_mm: [0, 262.0]}
frames:
  - parts:
      - kind: integer
        size: 3
        order: little
        payload_bits: 6
        tags: [0x00, 0x40, 0x80]
        specials: [{code: "\x3F\x7F\xBF", means: no object, status: fault, remedy: put something in front}]
timing: {rate_hz: 500, timeout_s: 1}
"""


@pytest.fixture(name="make")
def _make(tmp_path: Path):
    def make(text: str) -> Protocol:
        name = text.split("name: ", 1)[1].split("\n", 1)[0]
        file = tmp_path / f"{name}.yaml"
        file.write_text(text, encoding="utf-8")
        return load_instrument(file)

    return make


@pytest.mark.parametrize("text", [BINARY, TEXT, TAGGED])
def test_driver_and_virtual_instrument_agree(text: str, make) -> None:
    protocol = make(text)
    clock = ScaledClock(2)
    with (
        VirtualInstrument(protocol, lambda t_s: 1.0 + 0.001 * t_s, clock=clock) as virtual,
        Instrument(protocol, virtual.port, clock=clock) as instrument,
    ):
        readings = list(instrument.readings(60))
        instrument.stop()
    assert {reading.status for reading in readings} == {"ok"}
    assert instrument.tally.lost == instrument.tally.garbage_bytes == 0
    for reading in readings:
        assert reading.length_mm == pytest.approx(1.0 + 0.001 * reading.t_s, abs=0.002)
    assert virtual.unknown_bytes == 0


@pytest.mark.parametrize("text", [BINARY, TEXT, TAGGED])
def test_without_a_bar_each_says_so_in_its_own_way(text: str, make) -> None:
    protocol = make(text)
    with VirtualInstrument(protocol, lambda _: None) as virtual, Instrument(protocol, virtual.port) as instrument:
        reading = instrument.read()
    assert (reading.length_mm, reading.status) == (None, "fault")
    assert reading.said
    assert reading.remedy


def test_exact_bytes(make) -> None:
    binary, text, tagged = make(BINARY), make(TEXT), make(TAGGED)
    # Without the checksum, whose own test holds published check values.
    assert encode(binary, -1.0, counter=258)[:-2] == b"\xaa\x55\x02\x10\x27\x00\x00\x40"
    assert encode(text, 1.5) == b"M1,+1500.00,55\r"
    assert encode(text, None) == b"ER,00\r"
    assert encode(text, 1e6) == b"M1,+FFFFFFF,EB\r"
    assert decode(text, b"ER,17\r").said == "the head has no measurement"
    assert encode(tagged, 0.065) == b"\x01\x41\x80"
    assert decode(tagged, b"\x3f\x7f\xbf").status == "fault"


def test_the_start_and_stop_sequence_to_the_byte(make) -> None:
    protocol = make(BINARY)
    first, second = (encode(protocol, 1.0, counter=n) for n in (0, 1))
    script = (b"RESET\r", b"OK\r"), (b"RUN\r", b"OK\r" + first), (b"", second), (b"HALT\r", b"")
    with expected(*script) as port, Instrument(protocol, port) as instrument:
        assert [reading.counter for reading in instrument.readings(2)] == [0, 1]


@given(length_mm=st.floats(-200, 200), counter=st.integers(0, 1000), noise=st.binary(max_size=12))
def test_a_binary_stream_is_found_again_after_noise(
    tmp_path_factory, length_mm: float, counter: int, noise: bytes
) -> None:
    file = tmp_path_factory.mktemp("p") / "binary-probe.yaml"
    file.write_text(BINARY, encoding="utf-8")
    protocol = read_protocol(file)
    frames = b"".join(encode(protocol, length_mm, counter=counter + n) for n in range(4))
    decoder = Decoder(protocol, joining=False)
    heard = decoder.feed(frames[:20] + noise + frames[20:])
    readings = [one.reading for one in heard if isinstance(one, Piece)]
    assert all(reading.length_mm == pytest.approx(length_mm, abs=0.5001e-4) for reading in readings)
    assert [reading.counter for reading in readings][:2] == [counter % 256, (counter + 1) % 256]
    if not noise:
        assert len(readings) == 4
    assert b"".join(one.raw for one in heard) + decoder.pending == frames[:20] + noise + frames[20:]


def test_joining_a_binary_stream_in_the_middle(make) -> None:
    protocol = make(TAGGED)
    stream = b"".join(encode(protocol, 0.1 * n) for n in range(6))
    heard = Decoder(protocol, joining=True).feed(stream[1:])
    assert isinstance(heard[0], Garbage)
    assert heard[0].joining
    assert [one.reading.length_mm for one in heard[1:] if isinstance(one, Piece)] == pytest.approx(
        [0.1, 0.2, 0.3, 0.4, 0.5]
    )
