from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbbstation.instrument.codec import Decoder, Garbage, Heard, decode, encode
from dbbstation.instrument.doubt import Piece
from dbbstation.instrument.fields import NotUnderstood
from dbbstation.instrument.library import load_instrument

ND = load_instrument("heidenhain-nd281b")
ENCODER = load_instrument("streaming-encoder", "no-checksum")


@pytest.mark.parametrize(
    ("raw", "length_mm"),
    [
        (b"+  150.0003    \r\n", 150.0003),
        (b"-    5.2300    \r\n", -5.23),
        (b"+    0.0000    \r\n", 0.0),
        (b"+99999.9999    \r\n", 99999.9999),
        (b"-99999.9999    \r\n", -99999.9999),
    ],
)
def test_the_nd281b_says_a_length_in_exactly_these_bytes(raw: bytes, length_mm: float) -> None:
    assert encode(ND, length_mm) == raw
    reading = decode(ND, raw)
    assert (reading.length_mm, reading.status) == (length_mm, "ok")


@pytest.mark.parametrize(
    ("raw", "length_mm"),
    [
        (b"-      5.23  =A\r\n", -5.23),  # the example of the manual: two decimals, sorting and series on
        (b"   150.0003    \r\n", 150.0003),
        (b"+   .500000    \r\n", 0.5),
        (b'+   5.90552 "  \r\n', 5.90552 * 25.4),
        (b"+  150.0003  < \r\n", 150.0003),
        (b"+  150.0003  ? \r\n", 150.0003),
    ],
)
def test_the_nd281b_is_understood_with_other_settings(raw: bytes, length_mm: float) -> None:
    reading = decode(ND, raw)
    assert reading.length_mm == pytest.approx(length_mm, abs=1e-12)
    assert reading.status == "ok"


def test_the_nd281b_reports_a_fault_in_the_unit() -> None:
    assert encode(ND, None) == b"+    0.0000 ?  \r\n"
    reading = decode(ND, b"+    0.0000 ?  \r\n")
    assert (reading.length_mm, reading.status) == (None, "fault")
    assert reading.remedy.startswith("read the message")


@pytest.mark.parametrize("series", [b"S", b"G", b"D"])
def test_the_smallest_or_largest_of_a_series_is_no_length(series: bytes) -> None:
    assert decode(ND, b"+  150.0003  =" + series + b"\r\n").status == "fault"


def test_the_encoder_says_a_length_in_exactly_these_bytes() -> None:
    assert encode(ENCODER, 150.00031, counter=42) == b"00042,+0150.00031,A\r\n"
    assert encode(ENCODER, -0.5, counter=100_001) == b"00001,-0000.50000,A\r\n"
    reading = decode(ENCODER, b"00042,+0150.00031,A\r\n")
    assert (reading.length_mm, reading.counter, reading.status) == (150.00031, 42, "ok")


def test_a_length_that_does_not_fit_is_overrange() -> None:
    raw = encode(ENCODER, 12345.0, counter=7)
    assert raw == b"00007,+0000.00000,O\r\n"
    assert decode(ENCODER, raw).status == "overrange"


@given(st.floats(-99999.9999, 99999.9999), st.integers(0, 10**6))
def test_what_the_nd281b_writes_is_read_back(length_mm: float, counter: int) -> None:
    raw = encode(ND, length_mm, counter=counter)
    reading = decode(ND, raw)
    assert len(raw) == 17
    assert reading.length_mm == pytest.approx(length_mm, abs=0.5001e-4)
    assert encode(ND, reading.length_mm, counter=counter) == raw


@given(st.floats(-9999.99999, 9999.99999), st.integers(0, 10**6))
def test_what_the_encoder_writes_is_read_back(length_mm: float, counter: int) -> None:
    raw = encode(ENCODER, length_mm, counter=counter)
    reading = decode(ENCODER, raw)
    assert reading.length_mm == pytest.approx(length_mm, abs=0.5001e-5)
    assert reading.counter == counter % 100_000
    assert encode(ENCODER, reading.length_mm, counter=counter) == raw


@given(st.binary(max_size=60))
def test_garbage_never_raises_and_never_vanishes(raw: bytes) -> None:
    decoder = Decoder(ENCODER, joining=False)
    heard = decoder.feed(raw)
    assert b"".join(one.raw for one in heard) + decoder.pending == raw


@given(st.lists(st.floats(-500, 500), min_size=1, max_size=20), st.data())
def test_chunks_may_end_anywhere(lengths_mm: list[float], data: st.DataObject) -> None:
    raw = b"".join(encode(ENCODER, length_mm, counter=n) for n, length_mm in enumerate(lengths_mm))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(raw)), max_size=10)))
    decoder = Decoder(ENCODER, joining=False)
    heard: list[Heard] = []
    for start, end in zip([0, *cuts], [*cuts, len(raw)], strict=True):
        heard += decoder.feed(raw[start:end])
    assert [one.reading.counter for one in heard if isinstance(one, Piece)] == list(range(len(lengths_mm)))
    assert decoder.pending == b""


def test_joining_a_stream_in_mid_line_is_no_fault() -> None:
    decoder = Decoder(ENCODER, joining=True)
    heard = decoder.feed(b"50.00031,A\r\n00043,+0150.00031,A\r\n")
    assert isinstance(heard[0], Garbage)
    assert heard[0].joining
    assert isinstance(heard[1], Piece)


def test_a_line_without_end_is_garbage_in_the_end() -> None:
    heard = Decoder(ND, joining=False).feed(b"x" * 300)
    assert heard == [Garbage(b"x" * 300, "no line end in 256 bytes")]


@pytest.mark.parametrize(
    "raw", [b"+  15x.0003    \r\n", b"+  150.0003    \n", b"   .           \r\n", b"+ 1 50.0003    \r\n"]
)
def test_what_is_no_reading_is_refused(raw: bytes) -> None:
    with pytest.raises(NotUnderstood):
        decode(ND, raw)
