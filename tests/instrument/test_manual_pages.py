"""Bytes as the pages of the manuals show them, replayed through the protocol files.

What no page shows is not tested here; the files say `verified: false` of it.
"""

from __future__ import annotations

import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

from dbbstation.errors import InstrumentError
from dbbstation.instrument.codec import Decoder, Garbage, decode, encode
from dbbstation.instrument.doubt import Piece
from dbbstation.instrument.driver import Instrument
from dbbstation.instrument.library import (
    instruments_folder,
    known_instruments,
    load_instrument,
    load_variants,
    with_zero,
)
from dbbstation.virtual.wire import VirtualInstrument
from dbbstation.virtual.wire_clock import ScaledClock
from tests.instrument.scripted_port import expected

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from dbbstation.instrument.protocol import Protocol

ALL = [protocol for name in known_instruments() for protocol in load_variants(name)]
BAR_MM = 150.0003


def usable(protocol: Protocol) -> Protocol:
    return with_zero(protocol, 150.0) if protocol.length.relative else protocol


@contextmanager
def reading_of(protocol: Protocol, length_mm: float | None) -> Iterator[Instrument]:
    clock = ScaledClock(20.0 if protocol.ask.asked else 1.0)
    with (
        VirtualInstrument(protocol, lambda _: length_mm, clock=clock) as virtual,
        Instrument(protocol, virtual.port, clock=clock) as instrument,
    ):
        yield instrument


@pytest.mark.parametrize(
    ("name", "profile", "raw", "on_display_mm"),
    [
        # ND 281 B operating manual, version 2: page 47 (example of the reply), page 61 (actual value, no decimal point).
        ("heidenhain-nd281b", "stx", b"-      5.23  =A\r\n", -5.23),
        ("heidenhain-nd281b", "a0200", b"\x02+123456789\r\n", 12345.6789),
        ("heidenhain-nd281b", "a0200-inch", b"\x02+123456789\r\n", 1234.56789 * 25.4),
        # ND 287 user manual, page 108: displayed value.
        ("heidenhain-nd287", "stx", b"\x02-12345.6789\r\n", -12345.6789),
        ("heidenhain-nd287", "ack", b"\x06-12345.6789\r\n", -12345.6789),
        # OPTO-RS, Sylvac opto instruments, page 12: sign +, - or blank, digits, point, digits, CR.
        ("sylvac-opto-rs", "asked", b"+12.345\r", 12.345),
        ("sylvac-opto-rs", "asked", b"-12.34\r", -12.34),
        ("sylvac-opto-rs", "asked", b" 12.345\r", 12.345),
        ("sylvac-opto-rs", "inch", b"+.50000\r", 12.7),
        # TT80/TT90, page 29.
        ("tesa-tt80", "tt90", b"+123.456\r\n", 0.123456),
        ("tesa-tt80", "tt80", b"-0001.25\r\n", -1.25),
        ("tesa-tt80", "tt80-inch", b"+.012345\r\n", 0.012345 * 25.4),
        # Millimar C1202, page 82: examples with and without the symbols of tolerance and warning limits.
        ("mahr-c1202", "um", b"1 +012.34 um\r", 0.01234),
        ("mahr-c1202", "um", b"1 -012.34 um >\r", -0.01234),
        ("mahr-c1202", "um", b"1 +012.34 um = <\r", 0.01234),
        ("mahr-c1202", "um", b"1 +000.50 mm\r", 0.5),
        # DL-RS1A: GT2 edition page 13, GT-70A edition page 11, IL edition page 9.
        ("keyence-dl-rs1a", "gt2", b"M0,+012.3456\r\n", 12.3456),
        ("keyence-dl-rs1a", "gt-70a", b"M0,-012.345\r\n", -12.345),
        ("keyence-dl-rs1a", "il-300", b"M0,+123.45\r\n", 123.45),
    ],
)
def test_a_reply_of_the_manual_is_a_length(name: str, profile: str, raw: bytes, on_display_mm: float) -> None:
    reading = decode(load_instrument(name, profile), raw)
    assert reading.length_mm == pytest.approx(on_display_mm, abs=1e-9)
    assert reading.status == "ok"


@pytest.mark.parametrize(
    ("name", "profile", "raw", "status", "said"),
    [
        ("heidenhain-nd281b", "a0200", b"\x15", "fault", "does not allow the command"),  # page 61: NAK
        ("heidenhain-nd287", "stx", b"\x15", "fault", "does not allow the command"),  # page 108: NAK
        ("sylvac-opto-rs", "asked", b"ERR0\r", "fault", "sensor error"),
        ("sylvac-opto-rs", "asked", b"ERR1\r", "fault", "does not know the command"),
        ("sylvac-opto-rs", "asked", b"ERR2\r", "fault", "wrong parity"),
        ("sylvac-opto-rs", "asked", b"ERR3\r", "overrange", "beyond the measuring range"),
        ("sylvac-opto-rs", "asked", b"ERR7\r", "fault", "code 7, which its protocol file does not list"),
        ("tesa-tt80", "tt90", b"ERR23\r\n", "fault", "tolerances"),
        ("mahr-c1202", "um", b"ERR6\r", "fault", "feature 1 is switched off"),
        ("mahr-c1202", "um", b"1 ERR6\r", "fault", "feature 1 is switched off"),
        ("keyence-dl-rs1a", "gt2", b"ER,M0,00\r\n", "fault", "invalid command"),
        ("keyence-dl-rs1a", "gt2", b"ER,M0,02\r\n", "fault", "the amplifier does not answer"),
        ("keyence-dl-rs1a", "gt2", b"ER,M0,20\r\n", "fault", "wrong length"),
        ("keyence-dl-rs1a", "gt2", b"ER,M0,21\r\n", "fault", "number of parameters"),
        ("keyence-dl-rs1a", "gt2", b"ER,M0,22\r\n", "fault", "beyond its range"),
        ("keyence-dl-rs1a", "gt2", b"ER,M0,29\r\n", "fault", "serial line"),
        ("keyence-dl-rs1a", "gt2", b"ER,M0,65\r\n", "fault", "no amplifier has this ID"),
        # GT-70A edition, page 13: no 02 there.
        ("keyence-dl-rs1a", "gt-70a", b"ER,M0,02\r\n", "fault", "code 02, which its protocol file does not list"),
    ],
)
def test_an_error_of_the_manual_is_told_in_words(name: str, profile: str, raw: bytes, status: str, said: str) -> None:
    heard = Decoder(load_instrument(name, profile), joining=False).feed(raw)
    assert len(heard) == 1
    assert isinstance(heard[0], Piece)
    reading = heard[0].reading
    assert (reading.length_mm, reading.status) == (None, status)
    assert said in reading.said
    assert reading.remedy


def test_the_same_request_is_answered_otherwise_by_other_firmware() -> None:
    stx, ack = load_instrument("heidenhain-nd287"), load_instrument("heidenhain-nd287", "ack")
    assert stx.ask.request == ack.ask.request == b"\x1bA0100\r"
    for ours, theirs in ((stx, ack), (ack, stx)):
        assert isinstance(Decoder(ours, joining=False).feed(encode(theirs, BAR_MM))[0], Garbage)
        with expected(*[(ours.ask.request, encode(theirs, BAR_MM))] * 3) as port, Instrument(ours, port) as instrument:
            with pytest.raises(InstrumentError) as caught:
                instrument.read()
            assert f"--instrument heidenhain-nd287 --profile {theirs.profile}" in caught.value.remedy


def test_stx_is_the_request_and_the_prefix_of_the_reply() -> None:
    protocol = load_instrument("heidenhain-nd281b", "a0200")
    asked = protocol.ask.request
    with expected((asked, b"\x02\x02+001500003\r\n"), (asked, b"\x02+001500003\r\n")) as port:
        with Instrument(protocol, port) as instrument:
            reading = instrument.read()
        assert (reading.length_mm, reading.lost) == (150.0003, 1)
    plain = load_instrument("heidenhain-nd281b")
    with expected((b"\x02", b"+  150.0003    \r\n")) as port, Instrument(plain, port) as instrument:
        assert instrument.read().length_mm == 150.0003


def test_without_a_decimal_point_the_resolution_comes_from_the_profile(tmp_path: Path) -> None:
    raw = b"\x02+000150000\r\n"
    assert decode(load_instrument("heidenhain-nd281b", "a0200"), raw).length_mm == pytest.approx(15.0)
    text = """format: dbb-instrument/1
name: gauge
title: A display step of 1 µm as the usual one, 0.1 µm as a profile
profile: micrometre
line: {baud: 9600}
ask: {mode: poll, request: "?", request_end: "\\r"}
reply: {prefix: "\\x02", end: "\\r\\n"}
length: {unit: count, mm_per_count: 0.001, range_mm: [-1000, 1000]}
frames: [{parts: [{kind: decimal, width: 10, pad: "0", signed: true, plus: "+"}]}]
timing: {timeout_s: 1}
profiles:
  fine: {title: 0.1 µm, length: {mm_per_count: 0.0001}}
"""
    (tmp_path / "gauge.yaml").write_text(text, encoding="utf-8")
    for profile, length_mm in ((None, 150.0), ("micrometre", 150.0), ("fine", 15.0)):
        assert decode(load_instrument(tmp_path / "gauge.yaml", profile), raw).length_mm == pytest.approx(length_mm)
    with pytest.raises(InstrumentError, match=r"gauge has no profile 'fin'; did you mean fine\?"):
        load_instrument(tmp_path / "gauge.yaml", "fin")


def test_the_text_of_an_error_is_asked_for_once_while_it_lasts() -> None:
    """ND 281 B operating manual, version 2, page 61: error text of 13 characters."""
    protocol = load_instrument("heidenhain-nd281b")
    fault, value = b"+    0.0000 ?  \r\n", b"+  150.0003    \r\n"
    text = (b"\x1bA0301\r", b"\x02FORMAT.ERR.  \r\n")
    script = ((b"\x02", fault), text, (b"\x02", fault), (b"\x02", value), (b"\x02", fault), text, (b"\x02", value))
    with expected(*script) as port, Instrument(protocol, port) as instrument:
        readings = list(instrument.readings(5))
    said = [one.said for one in readings]
    assert said == ["the display shows: FORMAT.ERR."] * 2 + ["", "the display shows: FORMAT.ERR.", ""]


@pytest.mark.parametrize(
    ("answer", "fault"), [(b"\x06", None), (b"\x15", "the instrument refuses the command"), (b"\x02", "instead of")]
)
def test_key_commands_are_answered_by_ack_or_nak(tmp_path: Path, answer: bytes, fault: str | None) -> None:
    """ND 287 user manual, page 108. A start sequence may press keys; a display that refuses one is told of at once."""
    shipped = (instruments_folder() / "heidenhain-nd287.yaml").read_text(encoding="utf-8")
    keyed = shipped.replace("name: heidenhain-nd287", "name: keyed").replace(
        '  request_end: "\\r"\n',
        '  request_end: "\\r"\n  start: [{send: "\\x1BT0000", reply: "\\x06", refused: "\\x15"}]\n',
        1,
    )
    (tmp_path / "keyed.yaml").write_text(keyed, encoding="utf-8")
    protocol = load_instrument(tmp_path / "keyed.yaml")
    assert protocol.ask.start[0].send == b"\x1bT0000\r"
    if fault is None:
        script = ((b"\x1bT0000\r", answer), (protocol.ask.request, b"\x02-12345.6789\r\n"))
        with expected(*script) as port, Instrument(protocol, port) as instrument:
            assert instrument.read().length_mm == -12345.6789
        with VirtualInstrument(protocol, lambda _: BAR_MM) as virtual, Instrument(protocol, virtual.port) as instrument:
            assert instrument.read().length_mm == BAR_MM
        return
    began_s = time.monotonic()
    with expected((b"\x1bT0000\r", answer)) as port:
        with pytest.raises(InstrumentError, match=fault):
            Instrument(protocol, port, timeout_s=0.3).start()
        assert time.monotonic() - began_s < 5.0


def test_a_display_with_nothing_to_explain_says_nak() -> None:
    protocol = load_instrument("heidenhain-nd287")
    with (
        expected((protocol.ask.request, b"\x15"), (b"\x1bA0301\r", b"\x15"), (protocol.ask.request, b"")) as port,
        Instrument(protocol, port) as instrument,
    ):
        assert instrument.read().said == "the display does not allow the command now"
        time.sleep(0.05)


@pytest.mark.parametrize("protocol", ALL, ids=lambda one: one.label)
def test_driver_and_virtual_instrument_agree(protocol: Protocol) -> None:
    """Values to the last digit that the wire has; a gauge that rounds to 10 µm is allowed half of that."""
    protocol = usable(protocol)
    with reading_of(protocol, BAR_MM) as instrument:
        readings = list(instrument.readings(5))
        instrument.stop()
    assert {one.status for one in readings} == {"ok"}
    assert instrument.tally.lost == 0
    for one in readings:
        assert one.length_mm == pytest.approx(BAR_MM, abs=0.02)
        assert one.length_mm == decode(protocol, encode(protocol, BAR_MM)).length_mm or one.counter is not None


@pytest.mark.parametrize("protocol", ALL, ids=lambda one: one.label)
def test_without_a_bar_the_status_is_fault_with_words_and_remedy(protocol: Protocol) -> None:
    protocol = usable(protocol)
    with reading_of(protocol, None) as instrument:
        reading = instrument.read()
    assert (reading.length_mm, reading.status) == (None, "fault")
    assert reading.said
    assert reading.remedy


@pytest.mark.parametrize("protocol", ALL, ids=lambda one: one.label)
def test_every_statement_has_its_place(protocol: Protocol) -> None:
    assert protocol.references
    assert protocol.setup
    assert all(one.where for one in protocol.references)


def test_a_relative_gauge_needs_the_length_at_its_zero() -> None:
    gauge = load_instrument("tesa-tt80")
    with pytest.raises(
        InstrumentError, match="nobody says how long the bar is there; give the calibrated length with --zero-mm"
    ):
        with_zero(gauge, None)
    assert decode(with_zero(gauge, 150.0003), b"-000.300\r\n").length_mm == pytest.approx(150.0)
    assert decode(with_zero(gauge, 150.0003), b"+999.999\r\n").status == "ok"
    with pytest.raises(InstrumentError, match="it shows whole lengths"):
        with_zero(load_instrument("heidenhain-nd281b"), 150.0)


NEW = """format: dbb-instrument/1
name: millimar-c1240
title: Mahr Millimar C1208, C1216 or C1240, interface protocol OPTORSD
references:
  - {says: "? CR is answered by xxx.xxx, the unit, CR LF", where: "Millimar C1208/C1216/C1240 operating instructions, page 69", verified: true}
  - {says: baud rate and parity, where: set on the device; not on that page, verified: false}
line: {baud: 9600, data_bits: 7, parity: even, stop_bits: 2}
ask: {mode: poll, request: "?", request_end: "\\r"}
reply: {end: "\\r\\n"}
length: {unit: um, relative: true, range_mm: [-2.0, 2.0]}
frames:
  - parts:
      - {kind: decimal, max_width: 9, decimals: 3, decimals_vary: true, signed: true}
      - {kind: choice, codes: [{code: um, means: micrometres, unit: um}, {code: mm, means: millimetres, unit: mm}]}
timing: {reply_latency_s: 0.1, timeout_s: 1.0}
"""
"""An instrument that no shipped file has, from one page of its manual."""


def test_a_new_instrument_is_one_file_and_bytes_of_its_page(tmp_path: Path) -> None:
    (tmp_path / "millimar-c1240.yaml").write_text(NEW, encoding="utf-8")
    protocol = with_zero(load_instrument(tmp_path / "millimar-c1240.yaml"), 150.0)
    assert decode(protocol, b"123.456um\r\n").length_mm == pytest.approx(150.123456)
    assert decode(protocol, b"-0.125mm\r\n").length_mm == pytest.approx(149.875)
    clock = ScaledClock(20)
    with (
        VirtualInstrument(protocol, lambda _: BAR_MM, clock=clock) as virtual,
        Instrument(protocol, virtual.port, clock=clock) as instrument,
    ):
        assert instrument.read().length_mm == pytest.approx(BAR_MM, abs=1e-9)
