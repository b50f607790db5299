from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from dbbstation.errors import InputError, OutputError
from dbbstation.instrument.bytelog import ByteLog, Chunk, logged_instrument, read_byte_log
from dbbstation.instrument.driver import Instrument
from dbbstation.instrument.library import load_instrument
from dbbstation.instrument.replay import replayed
from tests.instrument.scripted_port import expected

if TYPE_CHECKING:
    from pathlib import Path

ND = load_instrument("heidenhain-nd281b")
ENCODER = load_instrument("streaming-encoder", "no-checksum")


def test_everything_on_the_line_is_written_down_and_replayed(tmp_path: Path) -> None:
    file = tmp_path / "bytes.txt"
    script = (b"\x02", b"+  150.0003    \r\n"), (b"\x02", b"+  1\xff0.0003    \r\n"), (b"\x02", b"-    5.2300    \r\n")
    with (
        ByteLog(file, instrument=ND.name, port="COM3") as log,
        expected(*script) as port,
        Instrument(ND, port, log=log) as instrument,
    ):
        live = list(instrument.readings(2))
    assert logged_instrument(file) == ("heidenhain-nd281b", "")
    chunks = list(read_byte_log(file))
    assert [chunk.raw for chunk in chunks[:2]] == [b"\x02", b"+  150.0003    \r\n"]
    assert [chunk.direction for chunk in chunks[:2]] == [">", "<"]
    rows = list(replayed(ND, chunks, where="x"))
    assert (
        [row.reading.length_mm for row in rows if row.reading] == [one.length_mm for one in live] == [150.0003, -5.23]
    )
    assert [row.raw for row in rows if row.reading is None] == [b"+  1\xff0.0003    \r\n"]


def test_the_log_is_text_that_people_can_read(tmp_path: Path) -> None:
    file = tmp_path / "bytes.txt"
    times_s = iter([10.0, 10.25, 10.5])
    with ByteLog(file, instrument="i", port="p", clock=lambda: next(times_s)) as log:
        log.note(">", b"\x02")
        log.note("<", b"+1\r\n")
    assert file.read_text(encoding="utf-8").splitlines() == [
        "# dbb-byte-log/1",
        "# instrument: i",
        "# port: p",
        "       0.250000 > 02  | .",
        "       0.500000 < 2b 31 0d 0a  | +1..",
    ]


def test_a_line_cut_off_by_a_crash_costs_that_line_alone(tmp_path: Path) -> None:
    file = tmp_path / "bytes.txt"
    file.write_text("# dbb-byte-log/1\n0.1 < 41 42\n0.2 < 43 4", encoding="utf-8")
    assert list(read_byte_log(file)) == [Chunk(0.1, "<", b"AB")]
    assert logged_instrument(file) == ("", "")


def test_replay_counts_gaps_and_shows_what_is_left(tmp_path: Path) -> None:
    file = tmp_path / "bytes.txt"
    with ByteLog(file, instrument=ENCODER.name, port="p") as log:
        log.note("<", b"0.0\r\n00006,+0150.00031,A\r\n00009,+0150.0")
        log.note("<", b"0032,A\r\nnoise\r\n00010,+0150.00032,A\r\n00002,+0150.00032,A\r\n00003,+01")
    rows = list(replayed(ENCODER, read_byte_log(file), where="x"))
    assert [row.reading.lost for row in rows if row.reading] == [0, 2, 0]
    assert [(row.raw, row.why) for row in rows if row.reading is None] == [
        (b"0.0\r\n", "joined in the middle"),
        (b"noise\r\n", "no frame of this protocol"),
        (b"00002,+0150.00032,A\r\n", "the sample counter 2 after 10 is out of order"),
        (b"00003,+01", "the log ends within it"),
    ]


def test_an_existing_log_is_kept(tmp_path: Path) -> None:
    file = tmp_path / "bytes.txt"
    file.write_text("mine", encoding="utf-8")
    with pytest.raises(OutputError, match=r"bytes\.txt: the byte log exists already; give another name or --force"):
        ByteLog(file, instrument="i", port="p")
    ByteLog(file, instrument="i", port="p", force=True).close()


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("hello\n", "bytes.txt:1:1: not a byte log"),
        ("# dbb-byte-log/1\n0.1 < zz\n", "bytes.txt:2:1: this line of the byte"),
    ],
)
def test_what_is_no_log_is_refused(tmp_path: Path, text: str, fault: str) -> None:
    file = tmp_path / "bytes.txt"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=fault):
        list(read_byte_log(file))
