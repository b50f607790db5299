"""A history of ten years of weekly sessions: working it out once, and opening it from its index, each command in a process of its own.

    python -m benchmarks.history [--quick] [--json]

520 sessions of the fifteen circles of [CAL Table II] in both directions, thirty runs at 10 Hz, made from one simulated session:
its lengths get a centre, a bar length and noise of their own in each. The peer of opening is the program's start (`--version`).
`--quick` takes 20 sessions.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

from benchmarks.measuring import Row, show, timed, timed_once  # isort: skip - sets up the environment

import numpy as np

from tests.plant.plan import table_ii_plan
from tests.plant.session import record

SEED = 8
SESSIONS, QUICK_SESSIONS = 520, 20
RATE_HZ = 10.0
WANTED_S = 3.0


def copies(one: Path, folder: Path, count: int) -> None:
    """Make weekly sessions of one: a smooth error and noise of its own in every run."""
    rng = np.random.default_rng(SEED)
    text = (one / "session.yaml").read_text("utf-8")
    runs = {path.name: path.read_text("utf-8").splitlines() for path in sorted((one / "runs").glob("*.csv"))}
    former = {name: hashlib.sha256((one / "runs" / name).read_bytes()).hexdigest() for name in runs}
    for week in range(count):
        place = folder / f"w{week + 1:03d}"
        shutil.copytree(one, place, ignore=shutil.ignore_patterns("runs", "session.yaml"))
        (place / "runs").mkdir()
        told = text
        for name, lines in runs.items():
            data = ("\n".join(_perturbed(lines, rng)) + "\n").encode()
            (place / "runs" / name).write_bytes(data)
            told = told.replace(former[name], hashlib.sha256(data).hexdigest())
        day = datetime(2016, 11, 20, tzinfo=UTC) + timedelta(weeks=week)
        (place / "session.yaml").write_text(re.sub(r"2026-11-20(?=T)", f"{day:%Y-%m-%d}", told), encoding="utf-8")


def _perturbed(lines: list[str], rng: np.random.Generator) -> list[str]:
    """Change the lengths of a run: another bar length, two undulations, noise; without checksums, which would not match."""
    header = next(k for k, line in enumerate(lines) if line.startswith("t_s"))
    names = lines[header].split(",")
    kept = [k for k, name in enumerate(names) if name != "crc"]
    cells = [[line.split(",")[k] for k in kept] for line in lines[header + 1 :]]
    at = [names[k] for k in kept].index("length_mm")
    time = np.array([float(row[0]) for row in cells])
    offset, *wave = rng.normal(0.0, 0.5e-3, 3)
    phase = 2.0 * np.pi * time / (time[-1] - time[0])
    change = offset + wave[0] * np.cos(2.0 * phase) + wave[1] * np.sin(2.0 * phase)
    for row, by in zip(cells, change + rng.normal(0.0, 0.2e-3, len(time)), strict=True):
        row[at] = f"{float(row[at]) + by:.6f}"
    return [*lines[:header], ",".join(names[k] for k in kept), *(",".join(row) for row in cells)]


def call(environment: dict[str, str], *words: str) -> None:
    """Run the program as people do."""
    done = subprocess.run(  # noqa: S603 - the program itself
        [sys.executable, "-m", "dbbstation", *words], env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise SystemExit(done.stderr)


def main() -> None:
    """Measure and print."""
    quick = "--quick" in sys.argv
    count = QUICK_SESSIONS if quick else SESSIONS
    with tempfile.TemporaryDirectory() as temporary:
        base = Path(temporary)
        environment = {**os.environ, "XDG_CACHE_HOME": str(base / "cache"), "DBBSTATION_LOG": "off"}
        record(base / "one", seed=SEED, plan=table_ii_plan(SEED), rate_hz=RATE_HZ)
        sessions = base / "sessions"
        copies(base / "one", sessions, count)
        made = timed_once(partial(call, environment, "history", str(sessions)))
        opened = timed(partial(call, environment, "history", str(sessions)), 5)
        started = timed(partial(call, environment, "--version"), 5)
        page = base / "history.html"
        drawn = timed(partial(call, environment, "history", str(sessions), "--page", str(page), "--force"), 3)
        index = next((base / "cache").rglob("*.sqlite"))
        shown = [
            Row("working it out once", made, "s", f"{count} sessions of 30 runs"),
            Row("  per session", made / count, "s"),
            Row("opening it from the index", opened.best_s, "s", f"wanted: below {WANTED_S:g}"),
            Row("  over the program's start", opened.best_s / started.best_s, "times"),
            Row("the same with --page", drawn.best_s, "s", f"page of {page.stat().st_size / 1e6:.1f} MB"),
            Row("size of the index", index.stat().st_size / 1e6, "MB"),
        ]
    show("history of weekly sessions" + (", quick form" if quick else ""), shown, "best of five; worked out once")


if __name__ == "__main__":
    main()
