from __future__ import annotations

import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbbstation.instrument.checksum_part import Algorithm, checksum


# Check values over "123456789" as the catalogue of parametrised CRC algorithms (G. Cook) gives them.
@pytest.mark.parametrize(
    ("algorithm", "value"),
    [
        ("crc8", 0xF4),
        ("crc16-modbus", 0x4B37),
        ("crc16-ccitt", 0x29B1),
        ("crc16-xmodem", 0x31C3),
        ("crc32", 0xCBF43926),
        ("sum8", 0xDD),
        ("sum16", 0x01DD),
        ("negated-sum8", 0x23),
        ("xor8", 0x31),
    ],
)
def test_check_values(algorithm: Algorithm, value: int) -> None:
    assert checksum(algorithm, b"123456789") == value


@given(st.binary())
def test_crc32_is_that_of_zlib(data: bytes) -> None:
    assert checksum("crc32", data) == zlib.crc32(data)
