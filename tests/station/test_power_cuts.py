"""Power cuts on a file system of its own: what was taken a second before is there, whatever the system had not written yet.

    pytest -m nightly tests/station/test_power_cuts.py -s        (as root: it mounts a loop device)

ext4 with `data=writeback`, which may write a file's length before its content, and XFS. A cut is a copy of the device's backing file while
the process that records stands still: what the system holds in memory, its log among it, is not in it. The copy is then mounted as
after a power cut, which replays the log.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from dbbstation.errors import InputError
from dbbstation.files.recordings.run_csv import read_run
from dbbstation.files.recordings.session import parse_session
from tests.station.kills import SAMPLES, STEP_S, length_mm, missing, record

if TYPE_CHECKING:
    from collections.abc import Iterator
    from multiprocessing.process import BaseProcess

PROMISED_S = 1.0
CUTS = 50
PACE_S = 0.002


@dataclass(frozen=True)
class FileSystem:
    """How one is made, and mounted while it is written and after the cut."""

    make: tuple[str, ...]
    image_bytes: int
    written: str
    after: str


FILE_SYSTEMS = {
    "ext4": FileSystem(("mkfs.ext4", "-q"), 48_000_000, "loop,data=writeback,commit=30", "loop"),
    "xfs": FileSystem(("mkfs.xfs", "-q"), 320_000_000, "loop", "loop,nouuid"),
}


def run(*words: object) -> None:
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False)
    if done.returncode:
        raise OSError(f"{words[0]}: {done.stderr.strip()}")


@contextlib.contextmanager
def mounted(image: Path, at: Path, options: str) -> Iterator[Path]:
    at.mkdir(exist_ok=True)
    run("mount", "-o", options, image, at)
    try:
        yield at
    finally:
        run("umount", at)


def made(image: Path, kind: FileSystem) -> Path:
    if shutil.which(kind.make[0]) is None:
        pytest.skip(f"{kind.make[0]} is not installed")
    with image.open("wb") as file:
        file.truncate(kind.image_bytes)
    try:
        run(*kind.make, image)
        with mounted(image, image.with_suffix(".try"), kind.written):
            pass
    except OSError as error:
        pytest.skip(f"no loop device can be mounted here: {error}")
    return image


@contextlib.contextmanager
def recording(folder: Path, told: int) -> Iterator[BaseProcess]:
    child = multiprocessing.get_context("fork").Process(target=record, args=(folder, told, PACE_S))
    child.start()
    os.close(told)
    try:
        yield child
    finally:
        child.kill()
        child.join()


class Told:
    """Lines of the process that records, with when they were read."""

    def __init__(self, handle: int) -> None:
        self._handle, self._rest = handle, b""
        os.set_blocking(handle, False)
        self.lines: list[tuple[float, str]] = []

    def read(self) -> None:
        with contextlib.suppress(BlockingIOError):
            while came := os.read(self._handle, 65536):
                *whole, self._rest = (self._rest + came).split(b"\n")
                self.lines += [(time.monotonic(), line.decode()) for line in whole]


def lost_in(folder: Path, promised: list[str], said: list[str]) -> tuple[int, int]:
    """How many samples that were promised, and verdicts and notes that were told, are not there; how many samples are others."""
    faults = []
    session = parse_session(folder, faults)
    assert session is not None, faults
    assert faults == []
    files = {f"{run.test}-{run.direction}-{run.repeat}": run.path for run in session.runs}
    lost, wrong = len(missing(session, said)), 0
    for name, count in Counter(line.split()[1] for line in promised if line.startswith("sample ")).items():
        there: dict[int, float] = {}
        with contextlib.suppress(InputError, KeyError):
            recording = read_run(files[name]).recording
            there = {
                round(t / STEP_S): mm
                for t, mm in zip(recording.t_s.tolist(), recording.length_mm.tolist(), strict=True)
            }
        lost += sum(k not in there for k in range(count))
        wrong += sum(mm != length_mm(name, k) for k, mm in there.items())
    return lost, wrong


@pytest.mark.nightly
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="loop devices of Linux")
@pytest.mark.parametrize("name", FILE_SYSTEMS)
def test_what_is_a_second_old_outlasts_a_power_cut(tmp_path: Path, name: str) -> None:
    rng, kind = random.Random(CUTS), FILE_SYSTEMS[name]  # noqa: S311 - moments, no secrets
    image = made(tmp_path / "disk.img", kind)
    table: Counter[str] = Counter()
    followed = lost = wrong = 0
    out, told = os.pipe()
    lines = Told(out)
    with contextlib.ExitStack() as stack:
        disk = stack.enter_context(mounted(image, tmp_path / "disk", kind.written))
        child = stack.enter_context(recording(disk / "session", told))
        for cut in range(CUTS):
            end_s = time.monotonic() + rng.uniform(1.2, 3.0)
            while time.monotonic() < end_s:
                lines.read()
                time.sleep(0.005)
            os.kill(child.pid, signal.SIGSTOP)
            stopped_s = time.monotonic()
            copy = tmp_path / f"cut-{cut}.img"
            run("cp", "--sparse=always", image, copy)
            os.kill(child.pid, signal.SIGCONT)
            promised = [line for when_s, line in lines.lines if when_s < stopped_s - PROMISED_S]
            said = [line for _, line in lines.lines]
            with mounted(copy, tmp_path / "copy", kind.after) as after:
                gone, other = lost_in(after / "session", promised, said)
            copy.unlink()
            followed += sum(line.startswith("sample ") for line in promised)
            lost, wrong = lost + gone, wrong + other
            last = lines.lines[-1][1].split()
            at_end = last[0] == "sample" and int(last[2]) == SAMPLES - 1
            table["while sealing" if at_end else "between samples" if last[0] == "sample" else f"behind {last[0]}"] += 1
    os.close(out)
    told_table = ", ".join(f"{count} {moment}" for moment, count in sorted(table.items()))
    sys.stdout.write(
        f"\n{name}: {CUTS} power cuts ({told_table}): {followed} samples promised, {lost} lost, {wrong} wrong\n"
    )
    assert (lost, wrong) == (0, 0)
