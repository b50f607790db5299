from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbbstation.instrument.protocol import LineSettings
from dbbstation.virtual.wire import heard_at

LINE = LineSettings(baud=9600)
SEVEN_EVEN_TWO = LineSettings(baud=9600, data_bits=7, parity="even", stop_bits=2)


@given(st.binary())
def test_the_same_rate_changes_nothing(raw: bytes) -> None:
    assert heard_at(raw, LINE, sent_baud=9600, heard_baud=9600) == raw
    assert heard_at(raw, LINE, sent_baud=9600, heard_baud=9800) == raw


def test_a_slow_byte_to_a_fast_ear() -> None:
    # "U" is bits 0 1010 1010 1 in time; at twice the rate each bit is heard twice: start, then 0 1 1 0 0 1 1 0 = 0x66.
    assert heard_at(b"U", LINE, sent_baud=9600, heard_baud=19200)[:1] == b"\x66"


def test_a_fast_byte_to_a_slow_ear() -> None:
    # Nine zero bits last four and a half: the start bit and three data bits, then the line is high.
    assert heard_at(b"\x00", LINE, sent_baud=19200, heard_baud=9600) == b"\xf8"


@pytest.mark.parametrize("heard", [1200, 4800, 19200, 115200])
@given(raw=st.binary(min_size=17, max_size=17))
def test_it_always_ends_and_stays_within_the_data_bits(heard: int, raw: bytes) -> None:
    out = heard_at(bytes(byte & 0x7F for byte in raw), SEVEN_EVEN_TWO, sent_baud=9600, heard_baud=heard)
    assert all(byte < 0x80 for byte in out)
    assert len(out) <= 17 * 11
