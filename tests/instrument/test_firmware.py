"""The streaming formats as firmware writes them: the program in C beside the documentation, byte for byte."""

from __future__ import annotations

import shutil
import subprocess
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.files.places import shipped_folder
from dbbstation.instrument.codec import Decoder, decode, encode
from dbbstation.instrument.doubt import Piece
from dbbstation.instrument.library import load_instrument

if TYPE_CHECKING:
    from pathlib import Path

TEXT, BINARY = load_instrument("streaming-encoder"), load_instrument("streaming-encoder-binary")
SOURCE = shipped_folder("fixtures") / "firmware" / "streaming_encoder.c"
STATUS = ["ok", "overrange", "fault"]


def crc16(raw: bytes) -> int:
    """CRC-16/IBM-3740 by its definition, bit by bit, apart from the package's: its check value is 0x29B1."""
    crc = 0xFFFF
    for byte in raw:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021) & 0xFFFF if crc & 0x8000 else crc << 1
    return crc


def test_the_crc_of_the_documentation() -> None:
    assert crc16(b"123456789") == 0x29B1
    body = b"00042,+0150.00031,A,"
    line = body + f"{crc16(body):04X}".encode() + b"\r\n"
    assert line == b"00042,+0150.00031,A,4C9A\r\n"
    assert encode(TEXT, 150.00031, counter=42) == line
    frame = bytes.fromhex("a55a 2a00 dfe1e400 00 00")
    assert encode(BINARY, 150.00031, counter=42) == frame + crc16(frame).to_bytes(2, "little")


@pytest.fixture(name="program", scope="module")
def _program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler: the listing is compared byte for byte where there is one")
    program = tmp_path_factory.mktemp("firmware") / "streaming"
    words = [
        compiler,
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-Wconversion",
        "-Werror",
        "-DEXAMPLE",
        "-o",
        str(program),
        str(SOURCE),
    ]
    subprocess.run(words, check=True)
    return program


def test_the_listing_in_c_writes_what_the_driver_reads(program: Path) -> None:
    dice = np.random.default_rng(18)
    counters = [0, 1, 42, 65_535, 65_536, 99_999, 100_000, 4_294_967_295, *dice.integers(0, 2**32, 300).tolist()]
    lengths = [0, 1, -1, 15_000_031, 999_999_999, -999_999_999, *dice.integers(-999_999_999, 10**9, 302).tolist()]
    rows = [(counter, length, place % 3) for place, (counter, length) in enumerate(zip(counters, lengths, strict=True))]
    asked = "".join(f"{counter} {length} {status}\n" for counter, length, status in rows)
    done = subprocess.run([program], input=asked, capture_output=True, text=True, check=True)
    for (counter, length, status), printed in zip(rows, done.stdout.split("\n"), strict=False):
        for protocol, raw in zip((TEXT, BINARY), map(bytes.fromhex, printed.split()), strict=True):
            reading = decode(protocol, raw)
            assert (reading.counter, reading.status) == (counter % (protocol.counter_modulus or 1), STATUS[status])
            if status != STATUS.index("fault"):
                assert reading.length_mm == pytest.approx(length / 1e5, abs=1e-9)
            if status == 0:
                assert encode(protocol, length / 1e5, counter=counter) == raw


def test_beyond_the_digits_of_the_text_it_says_end_of_travel(program: Path) -> None:
    done = subprocess.run([program], input="7 1000000000 0\n", capture_output=True, text=True, check=True)
    raw = bytes.fromhex(done.stdout.split()[0])
    assert raw.startswith(b"00007,+0000.00000,O,")
    assert decode(TEXT, raw).status == "overrange"


def test_a_stream_of_the_listing_is_found_after_noise(program: Path) -> None:
    asked = "".join(f"{count} {15_000_000 + count} 0\n" for count in range(50))
    done = subprocess.run([program], input=asked, capture_output=True, text=True, check=True)
    for column, protocol in enumerate((TEXT, BINARY)):
        frames = [bytes.fromhex(line.split()[column]) for line in done.stdout.splitlines()]
        raw = frames[0][5:] + b"".join(frames[1:20]) + b"\xa5\x5a\x00noise\r\n" + b"".join(frames[20:])
        heard = Decoder(protocol, joining=True).feed(raw)
        counters = [one.reading.counter for one in heard if isinstance(one, Piece)]
        assert counters == list(range(1, 50))
