"""The journal over kills and power cuts: no synced row is lost, no wrong row is ever returned."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import zlib
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbbstation.errors import InputError, OutputError
from dbbstation.files.recordings.journal import RunWriter, run_line
from dbbstation.files.recordings.run_csv import parse_run, read_run
from dbbstation.plan.plan import Direction

NAMES = ("t_s", "length_mm", "status")
BLOCK = 512
"""Smallest piece of a file that a disk writes at once."""


def writer_in(folder: Path, clock=lambda: 0.0, repeat: int = 1) -> RunWriter:
    return RunWriter(folder, "a", Direction.CCW, repeat, NAMES, clock)


def samples(count: int) -> list[tuple[float, float, str]]:
    return [(i * 0.02, 150.0 + i * 1.1e-5, "ok" if i % 7 else "overrange") for i in range(count)]


def written(folder: Path, count: int = 200) -> tuple[bytes, int]:
    with writer_in(folder) as writer:
        for index, sample in enumerate(samples(count)):
            writer.append(sample)
            if index == count // 2:
                writer.sync()
                synced = writer.path.stat().st_size
        return writer.path.read_bytes(), synced


@pytest.fixture(scope="module")
def journal(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, int]:
    return written(tmp_path_factory.mktemp("journal"))


def rows_of(data: bytes) -> list[tuple[float, float, bool]]:
    recording = parse_run(data, "a.csv.part", partial=True).recording
    return list(zip(recording.t_s, recording.length_mm, recording.usable, strict=True))


def rows_in(data: bytes) -> list[tuple[float, float, bool]]:
    rows = []
    for line in data.split(b"\n")[4:-1]:
        t_s, length_mm, status, _ = line.decode().split(",")
        rows.append((float(t_s), float(length_mm), status == "ok"))
    return rows


def survives(data: bytes, journal: tuple[bytes, int]) -> None:
    whole, synced = journal
    rows = rows_of(data)
    assert set(rows) <= set(rows_in(whole))
    assert set(rows_in(whole[:synced])) <= set(rows)
    assert rows == sorted(rows)


def test_a_run_from_start_to_seal(tmp_path: Path) -> None:
    with writer_in(tmp_path) as writer:
        for sample in samples(50):
            writer.append(sample)
        assert writer.path.name == "a-ccw-1.csv.part"
        digest = writer.seal()
    assert [path.name for path in tmp_path.iterdir()] == ["a-ccw-1.csv"]
    run = read_run(tmp_path / "a-ccw-1.csv", sha256=digest)
    assert run.header == {"test": "a", "direction": "ccw", "repeat": "1"}
    expected = [(round(t_s, 6), round(length_mm, 6), status == "ok") for t_s, length_mm, status in samples(50)]
    recording = run.recording
    assert list(zip(recording.t_s, recording.length_mm, recording.usable, strict=True)) == expected


def test_every_line_carries_its_own_checksum() -> None:
    line = run_line((0.5, 150.0000001, "ok"), NAMES)
    assert line == b"0.500000,150.000000,ok,%08x\n" % zlib.crc32(b"0.500000,150.000000,ok")


def test_power_cut_at_every_byte_of_the_last_lines(journal: tuple[bytes, int]) -> None:
    whole, synced = journal
    for size in (*range(synced, synced + 150), *range(len(whole) - 150, len(whole) + 1)):
        data = whole[:size]
        survives(data, journal)
        ended = data.count(b"\n") - 4
        # The checksum vouches for a line that only lacks its line end.
        vouched = whole[size : size + 1] == b"\n"
        assert len(rows_of(data)) == ended + vouched


@settings(max_examples=200, deadline=None)
@given(data=st.data())
def test_power_cut_that_mixes_blocks(journal: tuple[bytes, int], data: st.DataObject) -> None:
    whole, synced = journal
    size = data.draw(st.integers(synced, len(whole)))
    first = synced // BLOCK
    blocks = [whole[at : at + BLOCK] for at in range(0, size, BLOCK)]
    fates = st.sampled_from(["kept", "zeroed", "old", "swapped", "flipped"])
    for number in range(first, len(blocks)):
        fate = data.draw(fates)
        block = blocks[number]
        other = data.draw(st.integers(0, len(blocks) - 1))
        if fate == "zeroed":
            block = bytes(len(block))
        elif fate == "old":
            block = whole[other * BLOCK : other * BLOCK + len(block)].ljust(len(block), b"\0")
        elif fate == "swapped" and other > first:
            blocks[other], block = block, blocks[other]
        elif fate == "flipped":
            at = data.draw(st.integers(0, len(block) - 1))
            block = block[:at] + bytes([block[at] ^ 1 << data.draw(st.integers(0, 7))]) + block[at + 1 :]
        blocks[number] = block
    survived = b"".join(blocks)
    # What was synced is on the disk: the block it shares with later bytes came back at least that far.
    survives(whole[:synced] + survived[synced:], journal)


def test_a_hole_of_zeros_before_good_lines(journal: tuple[bytes, int]) -> None:
    whole, synced = journal
    end = whole.index(b"\n", synced + 300) + 1
    data = whole[:synced] + bytes(end - synced) + whole[end:]
    survives(data, journal)
    assert len(rows_of(data)) == 200 - whole[synced:end].count(b"\n")


def test_what_is_left_out_is_told(journal: tuple[bytes, int]) -> None:
    whole, synced = journal
    run = parse_run(whole[:synced] + b"1.5,what" + whole[synced:], "a.csv.part", partial=True)
    assert [(w.line, w.what) for w in run.warnings] == [
        (whole[:synced].count(b"\n") + 1, "the checksum does not match the line; it is left out")
    ]


def test_without_checksums_nothing_vouches_for_lines_after_a_step_back() -> None:
    text = b"t_s,length_mm\n0.0,150.0\n0.1,150.1\n0.05,150.2\n0.2,150.3\n"
    run = parse_run(text, "a.csv.part", partial=True)
    assert run.recording.t_s.tolist() == [0.0, 0.1]
    assert run.warnings[0].line == 4


def test_a_header_that_was_lost_is_an_error() -> None:
    with pytest.raises(InputError, match=r"no line that names the columns|column"):
        parse_run(bytes(600), "a.csv.part", partial=True)


def test_synced_twice_a_second_and_on_demand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    synced: list[int] = []
    writer = writer_in(tmp_path, lambda: now[0])
    fsync = os.fsync
    monkeypatch.setattr(os, "fsync", lambda handle: (fsync(handle), synced.append(writer.samples)))
    for index in range(300):
        now[0] = index * 0.01
        writer.append((now[0], 150.0, "ok"))
    assert synced == [51, 101, 151, 201, 251]
    writer.sync_if_due()
    assert len(synced) == 5
    now[0] = 10.0
    writer.sync_if_due()
    writer.sync()
    assert synced == [51, 101, 151, 201, 251, 300, 300]
    writer.close()


def test_killed_in_mid_run_nothing_is_lost(tmp_path: Path) -> None:
    program = (
        "import os, pathlib, signal, sys\n"
        "from dbbstation.files.recordings.journal import RunWriter\n"
        "from dbbstation.plan.plan import Direction\n"
        "writer = RunWriter(pathlib.Path(sys.argv[1]), 'a', Direction.CCW, 1, ('t_s', 'length_mm'))\n"
        "for i in range(1234):\n"
        "    writer.append((i / 1000, 150.0))\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    killed = subprocess.run([sys.executable, "-c", program, str(tmp_path)], check=False, timeout=60)
    assert killed.returncode == -signal.SIGKILL
    run = read_run(tmp_path / "a-ccw-1.csv.part")
    assert len(run.recording) == 1234
    assert run.warnings == ()


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    writer_in(tmp_path).close()
    with pytest.raises(OutputError, match="is being recorded, or was when the station died; take the next repeat"):
        writer_in(tmp_path)
    (tmp_path / "a-ccw-2.csv").write_text("kept")
    with pytest.raises(OutputError, match="exists already"):
        writer_in(tmp_path, repeat=2)
    writer = writer_in(tmp_path, repeat=3)
    writer.append((0.0, 150.0, "ok"))
    (tmp_path / "a-ccw-3.csv").write_text("kept")
    with pytest.raises(OutputError, match="exists already"):
        writer.seal()
    assert (tmp_path / "a-ccw-3.csv").read_text() == "kept"
    assert len(read_run(writer.path).recording) == 1


def test_a_full_disk_is_told_and_keeps_what_was_written(tmp_path: Path) -> None:
    class Full:
        def __init__(self, file: object) -> None:
            self.file = file

        def write(self, data: memoryview) -> int:
            # Half a line still finds room.
            self.file.write(data[: len(data) // 2])
            raise OSError(errno.ENOSPC, "No space left on device")

        def close(self) -> None:
            self.file.close()

    with writer_in(tmp_path) as writer:
        for sample in samples(10):
            writer.append(sample)
        writer._file = Full(writer._file)
        with pytest.raises(OutputError, match=r"no space left on device; free room"):
            writer.append((1.0, 150.0, "ok"))
    run = read_run(writer.path)
    assert len(run.recording) == 10
    assert "cut off" in run.warnings[0].what


def test_an_empty_run_is_not_sealed(tmp_path: Path) -> None:
    with writer_in(tmp_path) as writer, pytest.raises(OutputError, match="no sample was recorded"):
        writer.seal()
    assert writer.path.exists()


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="no such file or directory"):
        writer_in(tmp_path / "none")


def test_samples_that_have_no_place_in_a_run(tmp_path: Path) -> None:
    with writer_in(tmp_path) as writer:
        writer.append((1.0, 150.0, "ok"))
        for bad in [
            (1.0, 150.0, "ok"),
            (0.5, 150.0, "ok"),
            (2.0, float("nan"), "ok"),
            (2.0, 150.0, "a,b"),
            (2.0, 150.0),
        ]:
            with pytest.raises(ValueError, match=r"."):
                writer.append(bad)
    assert len(read_run(writer.path).recording) == 1
    with pytest.raises(ValueError, match="cannot have the columns"):
        RunWriter(tmp_path, "b", Direction.CW, 1, ("t_s", "length_mm", "colour"))
