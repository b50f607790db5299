"""A run and a verdict while one system call fails, writes half, or is the last: driven by `test_failing_calls`.

    LD_PRELOAD=failing_calls.so python -m tests.station.failing_calls SESSION SCRATCH EVERY BEGIN [WAY...]

The session is copied for every trial, and a forked process records a run into the copy, judges it, rejects another and notes
something. What it said is then held against the copy by a process in which nothing fails. Each fault is a line of the output.
"""

from __future__ import annotations

import ctypes
import errno
import os
import shutil
import sys
import traceback
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path

from dbbstation.errors import StationError
from dbbstation.files.formats.session import Counts, Note, RunState
from dbbstation.files.recordings.run_csv import read_run
from dbbstation.files.recordings.session import parse_session, read_session
from dbbstation.files.recordings.session_writer import SessionWriter
from dbbstation.plan.plan import Direction

BEGUN = datetime(2026, 11, 23, 8, tzinfo=UTC)
SAMPLES = 40
COLUMNS = ("t_s", "length_mm", "status")
FAILS, HALF, KILLS_BEFORE, KILLS_AFTER, FAILS_ON = range(5)
WAYS = {
    "EIO": (FAILS, errno.EIO),
    "ENOSPC": (FAILS, errno.ENOSPC),
    "EINTR": (FAILS, errno.EINTR),
    "short write": (HALF, 0),
    "disk full from there on": (FAILS_ON, errno.ENOSPC),
    "killed before": (KILLS_BEFORE, 0),
    "killed behind": (KILLS_AFTER, 0),
}


def scenario(folder: Path, tell) -> None:
    with SessionWriter.open(folder) as writer:
        tell("opened")
        with writer.start_run("a", Direction.CCW, COLUMNS, started=BEGUN, mounting=4) as journal:
            for k in range(SAMPLES):
                journal.append((k / 10, 150.0 + k / 1000, "ok"))
                tell("sample")
                if k % 10 == 0:
                    journal.sync()
            done = writer.finish_run(journal, Counts(SAMPLES, 0, {}))
        tell("sealed")
        writer.judge(done, accepted=True)
        tell("accepted")
        writer.judge(writer.runs[0], accepted=False, reason="chip")
        tell("rejected")
        writer.note(Note(BEGUN, "gate closed"))
        tell("noted")


def trial(calls: ctypes.CDLL, folder: Path, place: int, how: int, error: int) -> tuple[list[str], int]:
    out, told = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(out)
        try:
            calls.fail_arm(os.fsencode(folder), place, how, error)
            scenario(folder, lambda word: os.write(told, f"{word}\n".encode()))
        except StationError as problem:
            os.write(told, f"sentence {str(problem)!r}\n".encode())
        except BaseException:  # noqa: BLE001 - whatever it is, it is told
            os.write(told, f"fault {traceback.format_exc()!r}\n".encode())
        os.write(told, f"calls {calls.fail_count()}\n".encode())
        os._exit(0)
    os.close(told)
    said = b""
    while more := os.read(out, 65536):
        said += more
    os.close(out)
    os.waitpid(child, 0)
    lines = said.decode().splitlines()
    counted = [int(line.split()[1]) for line in lines if line.startswith("calls ")]
    return [line for line in lines if not line.startswith("calls ")], counted[0] if counted else 0


def faults_of(folder: Path, said: list[str], former: int) -> list[str]:
    found = [line for line in said if line.startswith("fault")]
    sentences = [line for line in said if line.startswith("sentence")]
    found += [f"more than a sentence: {line}" for line in sentences if "\\n" in line or "; " not in line]
    problems: list = []
    session = parse_session(folder, problems)
    found += [f"session: {problem}" for problem in problems]
    if session is None or problems:
        return found
    runs = {run.label: run for run in session.runs}
    samples = said.count("sample")
    mine = runs.get("a ccw 2")
    if samples:
        there = len(read_run(mine.path).recording) if mine is not None else 0
        lengths = read_run(mine.path).recording.length_mm.tolist() if mine is not None else []
        if there < samples or lengths != [round(150.0 + k / 1000, 6) for k in range(there)]:
            found.append(f"{there} of {samples} samples")
    if "sealed" in said and (mine is None or mine.state not in {RunState.COMPLETE, RunState.ACCEPTED}):
        found.append("sealed run lost")
    if "accepted" in said and (mine is None or mine.state is not RunState.ACCEPTED):
        found.append("verdict lost")
    if "rejected" in said and session.runs[0].reason != "chip":
        found.append("other verdict lost")
    if "noted" in said and "gate closed" not in {note.text for note in session.notes}:
        found.append("note lost")
    try:
        with SessionWriter.open(folder) as writer:
            if len(writer.runs) < former:
                found.append("runs lost")
    except StationError as problem:
        found.append(f"cannot go on: {problem}")
    left = [path.name for path in folder.rglob("*.new")]
    return [*found, *(f"left over: {name}" for name in left)]


def main() -> None:
    source, scratch, every, begin = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    calls = ctypes.CDLL(None)
    calls.fail_count.restype = ctypes.c_long
    calls.fail_arm.argtypes = [ctypes.c_char_p, ctypes.c_long, ctypes.c_int, ctypes.c_int]
    former = len(read_session(source).runs)

    def copied() -> Path:
        shutil.rmtree(scratch / "trial", ignore_errors=True)
        return Path(shutil.copytree(source, scratch / "trial"))

    said, total = trial(calls, copied(), 0, FAILS, 0)
    if said[-1] != "noted" or not total:
        raise SystemExit(f"the scenario itself fails: {said}")
    for name in sys.argv[5:] or WAYS:
        how, error = WAYS[name]
        ends: Counter[str] = Counter()
        for place in range(begin, total + 1, every):
            folder = copied()
            said, _ = trial(calls, folder, place, how, error)
            ends[
                "one sentence"
                if said and said[-1].startswith("sentence")
                else "went on"
                if "noted" in said
                else "killed"
            ] += 1
            for fault in faults_of(folder, said, former):
                sys.stdout.write(f"FAULT {name} at call {place}: {fault}\n")
        table = ", ".join(f"{count} {end}" for end, count in sorted(ends.items()))
        sys.stdout.write(f"{name}: {sum(ends.values())} of {total} calls: {table}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
