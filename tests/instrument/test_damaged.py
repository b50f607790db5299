"""Characters with a wrong parity: marked by the system, never in a reading, counted.

A pseudo-terminal has no parity bit: Linux refuses to set one. What can be shown on it is that the system takes the settings and
escapes FF as it does for marks; the marks themselves are tested as bytes.
"""

from __future__ import annotations

import contextlib
import os
import pty
import termios
import tty
from typing import TYPE_CHECKING

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from dbbstation.errors import InstrumentError
from dbbstation.instrument import driver
from dbbstation.instrument.bytelog import ByteLog, read_byte_log
from dbbstation.instrument.codec import Decoder, Garbage
from dbbstation.instrument.damaged import Marks
from dbbstation.instrument.driver import Instrument
from dbbstation.instrument.library import load_instrument
from dbbstation.instrument.link import Link, open_link
from dbbstation.instrument.replay import replayed
from tests.instrument.scripted_port import expected

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from pathlib import Path

ND = load_instrument("heidenhain-nd281b")
STREAM = load_instrument("streaming-encoder")
BINARY = load_instrument("streaming-encoder-binary")


ND_FRAME = b"+  150.0003    \r\n"


@pytest.fixture
def terminal() -> Iterator[tuple[int, int]]:
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    yield ours, theirs
    os.close(ours)
    os.close(theirs)


def test_pyserial_lets_no_port_tell_of_wrong_parity(terminal: tuple[int, int]) -> None:
    _, theirs = terminal
    settings = termios.tcgetattr(theirs)
    settings[0] |= termios.INPCK | termios.PARMRK
    termios.tcsetattr(theirs, termios.TCSANOW, settings)
    with serial.Serial(os.ttyname(theirs)) as port:
        assert termios.tcgetattr(port.fd)[0] & (termios.INPCK | termios.PARMRK) == 0


def test_a_port_of_text_is_opened_with_wrong_parity_marked(terminal: tuple[int, int]) -> None:
    ours, theirs = terminal
    name = os.ttyname(theirs)
    link = open_link(name, ND.line, text=ND.is_text)
    settings = termios.tcgetattr(theirs)
    assert settings[0] & termios.INPCK
    assert settings[0] & termios.PARMRK
    assert not settings[0] & (termios.IGNPAR | termios.ISTRIP)
    assert link.sees_damage
    # The system writes FF as FF FF now, and the link takes that out again.
    os.write(ours, b"a\xffb")
    assert link.read() == b"a\xffb"
    link.close()


def test_a_pseudo_terminal_takes_no_parity(terminal: tuple[int, int]) -> None:
    settings = termios.tcgetattr(terminal[1])
    settings[2] |= termios.PARENB
    # Linux refuses, other systems take it and do nothing.
    with contextlib.suppress(termios.error):
        termios.tcsetattr(terminal[1], termios.TCSANOW, settings)
    os.write(terminal[0], b"\x31\xb1")
    assert os.read(terminal[1], 2) == b"\x31\xb1"


def test_bytes_of_numbers_are_not_marked(terminal: tuple[int, int]) -> None:
    assert not BINARY.is_text
    link = open_link(os.ttyname(terminal[1]), BINARY.line, text=BINARY.is_text)
    assert not link.sees_damage
    os.write(terminal[0], b"\xff\xff\x00A")
    assert link.read() == b"\xff\xff\x00A"
    link.close()


@pytest.mark.parametrize(
    ("marked", "seven", "eight"),
    [
        (b"+ 150", b"+ 150", b"+ 150"),
        (b"+\xff\x00150", b"+\xb150", b"+\x0050"),
        (b"\xff\x00\x00", b"\x80", b"\x00"),  # a break
        (b"\xff\xff", b"\xff", b"\xff"),
        (b"\xff\xff\x001", b"\xff\x001", b"\xff\x001"),
        (b"\xff\x00\xff1", b"\xff1", b"\x001"),
    ],
)
def test_marks_are_taken_out_wherever_reads_end(marked: bytes, seven: bytes, eight: bytes) -> None:
    """IEEE Std 1003.1-2017, 11.2.2: FF 00 X for a wrong X, FF FF for a right FF, FF 00 00 for a break."""
    for data_bits, told in ((7, seven), (8, eight)):
        for first in range(len(marked) + 1):
            for second in range(first, len(marked) + 1):
                marks = Marks(data_bits)
                parts = (marked[:first], marked[first:second], marked[second:])
                assert b"".join(map(marks.taken_out, parts)) == told


@given(characters=st.lists(st.tuples(st.integers(0, 127), st.booleans())), cut=st.integers(0, 300))
def test_every_character_keeps_its_place_and_its_verdict(characters: list[tuple[int, bool]], cut: int) -> None:
    marked = b"".join(bytes([0xFF, 0, one]) if wrong else bytes([one]) for one, wrong in characters)
    marks = Marks(7)
    told = marks.taken_out(marked[:cut]) + marks.taken_out(marked[cut:])
    assert [(byte & 0x7F, byte > 0x7F) for byte in told] == characters


@pytest.mark.parametrize("place", range(17))
def test_no_character_with_wrong_parity_is_part_of_a_reading(place: int) -> None:
    good = b"+  150.0003    \r\n" + b"+  150.0003    \r\n"
    marked = good[:place] + bytes([0xFF, 0, good[place]]) + good[place + 1 :]
    heard = Decoder(ND, joining=False).feed(Marks(7).taken_out(marked))
    assert isinstance(heard[0], Garbage)
    assert heard[0].reason == "parity"
    assert "1 character with a wrong parity" in heard[0].why


def _with_marks(monkeypatch: pytest.MonkeyPatch) -> None:
    def opened(port: object, _line: object, *, log: ByteLog | None = None, **_: object) -> Link:
        return Link(port, name="marked", owned=False, log=log, marks=Marks(7))  # type: ignore[arg-type]

    monkeypatch.setattr(driver, "open_link", opened)


def test_a_reply_with_wrong_parity_is_asked_for_again_and_counted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """`1` of 150 arrives as `3`: one bit. Without the parity that is a length that is 200 mm too long."""
    _with_marks(monkeypatch)
    damaged = b"+  \xff\x003" + b"50.0003    \r\n"
    log = tmp_path / "bytes.txt"
    with (
        ByteLog(log, instrument=ND.name, port="marked") as book,
        expected((b"\x02", damaged), (b"\x02", b"+  150.0004    \r\n")) as port,
        Instrument(ND, port, log=book) as instrument,
    ):
        reading = instrument.read()
        assert instrument.unreadable() == {"parity": 1}
    assert (reading.length_mm, reading.status, reading.lost) == (150.0004, "ok", 1)
    # The log has the character as it came, with its mark, and says the same when it is replayed.
    rows = list(replayed(ND, read_byte_log(log), where="log"))
    assert [row.reading and row.reading.length_mm for row in rows] == [None, 150.0004]
    assert rows[0].raw[3] == ord("3") | 0x80
    assert "wrong parity" in rows[0].why


@pytest.mark.parametrize(
    ("wrong", "remedy"),
    [(range(17), "17 of its 17 characters came with a wrong parity: set the device to 9600 baud, 7 data bits, even parity, 2 stop bits"),
     ([k for k, one in enumerate(ND_FRAME) if one.bit_count() % 2],
      "8 of its 17 characters came with a wrong parity: set the device to 9600 baud, 7 data bits, even parity, 2 stop bits"),
     ((4,), "1 of its 17 characters came with a wrong parity: look after the cable")],
    ids=["another parity", "no parity", "noise"],
)  # fmt: skip
def test_noise_and_another_parity_are_told_apart(
    monkeypatch: pytest.MonkeyPatch, wrong: Collection[int], remedy: str
) -> None:
    _with_marks(monkeypatch)
    raw = b"".join(bytes([0xFF, 0, one]) if k in wrong else bytes([one]) for k, one in enumerate(ND_FRAME))
    with (
        expected(*[(b"\x02", raw)] * 3) as port,
        Instrument(ND, port, timeout_s=0.2) as instrument,
        pytest.raises(InstrumentError) as caught,
    ):
        instrument.read()
    assert remedy in caught.value.remedy
