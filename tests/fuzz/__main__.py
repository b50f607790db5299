"""Spoilt files of every format into every command: what becomes of them.

    python -m tests.fuzz FOLDER --cases 50000 --seed 1

Goes on where an earlier call with the same folder and seed ended; `--report` only counts. It fails where a case had an
internal fault, took more than 500 MB, or 20 s beyond the work of its command on the sound files.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

MOST_MB, MOST_S = 500, 20.0
STUCK_S = 600.0
"""A worker that says nothing for so long is ended: a case that does not even take time."""


def cases_of(folder: Path) -> dict[int, dict]:
    lines = [line for book in sorted(folder.glob("worker-*/cases.jsonl")) for line in lines_of(book)]
    return {told["case"]: told for told in lines if "case" in told}


def lines_of(book: Path) -> list[dict]:
    return [json.loads(line) for line in book.read_text(encoding="utf-8").split("\n")[:-1]]


def note_death(book: Path) -> None:
    begun = [line["begun"] for line in lines_of(book) if "begun" in line]
    died = {"case": begun[-1] if begun else 0, "kind": "?", "line": "?", "fault": "the process died", "guided": False}
    with book.open("a", encoding="utf-8") as file:
        file.write(json.dumps(died | {"cpu_s": 0.0, "peak_mb": 0, "code": None}) + "\n")


def work(folder: Path, seed: int, cases: int, workers: int) -> None:
    running: dict[int, subprocess.Popen[bytes]] = {}
    over: set[int] = set()
    try:
        while len(over) < workers:
            for k in set(range(workers)) - over:
                process = running.get(k)
                book = folder / f"worker-{k}" / "cases.jsonl"
                if process is not None and process.poll() is None:
                    if time.time() - book.stat().st_mtime > STUCK_S:
                        process.kill()
                    continue
                if process is not None and process.returncode != 0:
                    note_death(book)
                book.parent.mkdir(parents=True, exist_ok=True)
                book.touch()
                first = max([k - workers, *(line["case"] for line in lines_of(book) if "case" in line)]) + workers
                if first >= cases:
                    over.add(k)
                    continue
                command = [sys.executable, "-m", "tests.fuzz.worker", str(book.parent)]
                running[k] = subprocess.Popen([*command, *map(str, (seed, first, workers, cases))])
            time.sleep(0.2)
    finally:
        for process in running.values():
            process.kill()
            process.wait()


def report(found: dict[int, dict]) -> bool:
    guided = sum(told["guided"] for told in found.values())
    print(
        f"{len(found)} cases, {guided} of them guided; exit codes {dict(Counter(str(t['code']) for t in found.values()))}"
    )
    faults = Counter(
        (told["fault"].partition(": ")[0], told["line"].split()[0]) for told in found.values() if told["fault"]
    )
    for (fault, command), count in faults.most_common():
        first = next(t for t in found.values() if t["fault"].startswith(fault) and t["line"].split()[0] == command)
        print(f"  {count} x {fault} in {command}: case {first['case']} ({first['kind']}): {first['fault']}")
    large = [told for told in found.values() if told["peak_mb"] > MOST_MB]
    slow = [told for told in found.values() if told["cpu_s"] > MOST_S]
    for told in [*large, *slow]:
        print(f"  {told['peak_mb']} MB, {told['cpu_s']} s: case {told['case']} ({told['kind']}): {told['line']}")
    print(
        f"{sum(faults.values())} internal faults, {len(large)} over {MOST_MB} MB, {len(slow)} over {MOST_S:g} s of processor time"
    )
    greatest = [max((told[key] for told in found.values()), default=0) for key in ("peak_mb", "cpu_s")]
    print(f"greatest: {greatest[0]} MB, {greatest[1]} s")
    return not faults and not large and not slow


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cases", type=int, default=50_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--report", action="store_true")
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    if not asked.report:
        work(asked.folder, asked.seed, asked.cases, asked.workers)
    sys.exit(0 if report(cases_of(asked.folder)) else 1)


if __name__ == "__main__":
    main()
