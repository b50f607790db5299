"""Runs commands on spoilt files in this process, one after the other, and says what came of each.

    python -m tests.fuzz.worker FOLDER SEED FIRST STEP LAST

Case `i` is drawn from the seed and `i` alone where `i` is even. An odd one is spoilt further from files that reached lines
of the program which no file had reached before; they are kept in the folder.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import random
import re
import resource
import shutil
import signal
import sys
import time
import traceback
import warnings
from pathlib import Path

from tests.fuzz.mutate import FORGED, disturb, spoil
from tests.fuzz.seeds import SEEDS, Seed

TRACED = ("files", "cli", "nc", "instrument", "tasks", "trace", "plan", "machine")
"""Parts of the package whose lines guide."""

LONGEST_S = 60.0
"""A case that takes longer is stopped."""

MANY, DISTURBED = 2, 0.4
"""Seeds with more files are folders: the share of their cases in which files are missing, moved or added, too."""

_PACKAGE = f"{os.sep}dbbstation{os.sep}"
_Lines = set[tuple[str, int]]


class TooSlowError(BaseException):
    """A case took too long; no `Exception`, so that nobody holds it up."""


def guided_by(name: str) -> bool:
    _, found, inside = name.rpartition(_PACKAGE)
    return bool(found) and inside.startswith(TRACED)


class Reached:
    """Lines of the program that cases have reached, and the files that reached new ones."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.lines: _Lines = set()
        self.now: _Lines = set()
        self._here: dict[str, bool] = {}

    def traced(self, frame, event, _arg):
        name = frame.f_code.co_filename
        if name not in self._here:
            self._here[name] = guided_by(name)
        if not self._here[name]:
            return None
        if event == "line":
            self.now.add((name, frame.f_lineno))
        return self.traced

    @contextlib.contextmanager
    def watching(self):
        self.now = set()
        sys.settrace(self.traced)
        try:
            yield
        finally:
            sys.settrace(None)

    def keep(self, seed: Seed, target: str, data: bytes) -> bool:
        new = self.now - self.lines
        self.lines |= new
        if new:
            name = f"{SEEDS.index(seed)}-{hashlib.sha256(data).hexdigest()[:12]}"
            (self.folder / name).write_bytes(target.encode() + b"\n" + data)
        return bool(new)

    def starting(self, seed: Seed, rng: random.Random) -> tuple[str, bytes]:
        kept = sorted(self.folder.glob(f"{SEEDS.index(seed)}-*"))
        if kept and rng.random() < 0.8:
            target, _, data = rng.choice(kept).read_bytes().partition(b"\n")
            return target.decode(), data
        target = rng.choice(seed.targets)
        return target, seed.files[target]


def _peak_mb() -> float:
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return int(re.search(r"VmHWM:\s+(\d+)", status)[1]) / 1024


def _forget_peak() -> None:
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def place(files: dict[str, bytes], folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "out").mkdir(parents=True)
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


def run(line: str, folder: Path) -> tuple[int | None, str]:
    """Run a command in a folder; return its exit code, None where it left by an exception, and what it said of a fault."""
    from dbbstation.cli import main  # noqa: PLC0415 (after the limits are set)

    out, err = io.StringIO(), io.StringIO()
    before = Path.cwd()
    os.chdir(folder)
    code: int | None = None
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            main(["--debug", *line.split()])
    except SystemExit as left:
        code = left.code if isinstance(left.code, int) else 1
        said = (out.getvalue() + "\n" + err.getvalue()).splitlines()
        return code, "Forged: a name makes a line" if any(line.lstrip().startswith(FORGED) for line in said) else ""
    except Exception as error:  # noqa: BLE001 (that is what is looked for)
        from dbbstation.errors import StationError  # noqa: PLC0415

        if isinstance(error, StationError | OSError):
            return 1, ""
        frames = [one for one in traceback.extract_tb(error.__traceback__) if _PACKAGE in one.filename]
        last = frames[-1] if frames else None
        at = f"{last.filename.rpartition(_PACKAGE)[2]}:{last.lineno}" if last else "?"
        return None, f"{type(error).__name__} at {at}: {str(error)[:200]}"
    finally:
        os.chdir(before)
    return code, ""


def case(number: int, seed_number: int, folder: Path, reached: Reached) -> dict[str, object]:
    rng = random.Random(f"{seed_number}:{number}")  # noqa: S311 (no secret)
    seed = rng.choices(SEEDS, [one.share for one in SEEDS])[0]
    line = rng.choices(list(seed.commands), list(seed.commands.values()))[0]
    guided = number % 2 == 1
    if guided:
        target, data = reached.starting(seed, rng)
    else:
        target = rng.choice(seed.targets)
        data = seed.files[target]
    data = spoil(data, rng, list(seed.files.values()))
    here = folder / "case"
    place({**seed.files, target: data}, here)
    disturbed = len(seed.files) > MANY and rng.random() < DISTURBED
    if disturbed:
        disturb(here, rng)
    _forget_peak()
    began_s = time.monotonic()
    used_s = time.process_time()
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    try:
        with reached.watching() if guided else contextlib.nullcontext():
            code, fault = run(line, here)
    except TooSlowError:
        code, fault = None, ""
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    told: dict[str, object] = {
        "case": number, "kind": seed.kind, "line": line, "file": target, "guided": guided, "disturbed": disturbed, "code": code, "fault": fault,
        "cpu_s": round(time.process_time() - used_s, 3), "wall_s": round(time.monotonic() - began_s, 2), "peak_mb": round(_peak_mb()),
    }  # fmt: skip
    if guided:
        told["new"] = reached.keep(seed, target, data)
    if fault or told["cpu_s"] > 15.0 or told["peak_mb"] > 450:
        kept = folder / "found" / f"{number}"
        kept.parent.mkdir(exist_ok=True)
        kept.write_bytes(data)
    return told


def _too_slow(*_: object) -> None:
    raise TooSlowError


def main(folder: Path, seed_number: int, first: int, step: int, last: int) -> bool:
    """Run cases, and return whether this process is small enough for more."""
    os.environ |= {
        "DBBSTATION_LOG": "off",
        "XDG_CACHE_HOME": str(folder),
        "XDG_STATE_HOME": str(folder),
        "XDG_CONFIG_HOME": str(folder),
    }
    resource.setrlimit(resource.RLIMIT_AS, (6_000_000_000, 6_000_000_000))
    signal.signal(signal.SIGPROF, _too_slow)
    kept = folder.parent / "kept"
    kept.mkdir(exist_ok=True)
    reached = Reached(kept)
    with (folder / "cases.jsonl").open("a", encoding="utf-8") as book:
        for number in range(first, last, step):
            book.write(json.dumps({"begun": number}) + "\n")
            book.flush()
            told = case(number, seed_number, folder, reached)
            book.write(json.dumps(told) + "\n")
            book.flush()
            if told["peak_mb"] > 450:
                return False  # a new process begins with little memory
    return True


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve(), *map(int, sys.argv[2:6]))
