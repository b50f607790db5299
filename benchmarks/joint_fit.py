"""A joint calibration of many sessions: processor time and memory over the number of sessions.

    python benchmarks/joint_fit.py [--sessions 5,10,20,40] [--json]

The simulated machine of the tests records sessions of thirty runs, each with mountings, balls and a bar of its own: the fifteen circles
of [CAL Table II] in both directions at 10 Hz, joints off by 0.1 mm, noise 0.5 µm. Each number of sessions is calibrated in a process of
its own: reading, fit, search for outliers, figures. Its processor time and its greatest memory are those of the whole process.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.measuring import ROOT, Row, show  # isort: skip - sets up the environment

import numpy as np

from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.session import record

SEED = 36
NUMBERS = (5, 10, 20, 40)
WANTED_S, WANTED_MB = 60.0, 1000.0
"""For forty sessions."""

WORK = """
import json, resource, sys, time
from dbbstation.tasks.calibrate import calibrate
done = calibrate(sys.argv[1:])
used = resource.getrusage(resource.RUSAGE_SELF)
print(json.dumps({"s": time.process_time(), "mb": used.ru_maxrss / (1024 if sys.platform == "linux" else 1024**2)}))
"""


def main() -> None:
    """Measure and print."""
    named = next((sys.argv[k + 1] for k, argument in enumerate(sys.argv[:-1]) if argument == "--sessions"), "")
    numbers = tuple(map(int, named.split(","))) if named else NUMBERS
    with tempfile.TemporaryDirectory() as made:
        sessions = recorded(Path(made), max(numbers))
        rows = [row for number in numbers for row in measured(sessions[:number])]
    show("joint calibration of sessions of thirty runs", rows, "one process for each number of sessions")


def recorded(folder: Path, count: int) -> list[Path]:
    """Make sessions of one machine."""
    rng = np.random.default_rng(SEED)
    errors = Kinematics(length_mm=rng.normal(0.0, 0.05, 6), base_mm=rng.normal(0.0, 0.1, (6, 3)))
    sessions = [folder / f"s{k:02d}" for k in range(count)]
    for k, session in enumerate(sessions):
        record(session, seed=100 + k, mechanisms=[errors], rate_hz=10.0)
    return sessions


def measured(sessions: list[Path]) -> list[Row]:
    """Processor time and memory of one number of sessions."""
    line = [sys.executable, "-c", WORK, *map(str, sessions)]
    done = subprocess.run(line, check=True, capture_output=True, text=True, cwd=ROOT)  # noqa: S603 - this file's own program
    used = json.loads(done.stdout.splitlines()[-1])
    number = len(sessions)
    wanted = (
        (f"wanted for forty: {WANTED_S:.0f}", f"wanted for forty: {WANTED_MB:.0f}")
        if number == NUMBERS[-1]
        else ("", "")
    )
    return [
        Row(f"{number} sessions", used["s"], "s", wanted[0]),
        Row("  memory", used["mb"], "MB", wanted[1]),
    ]


if __name__ == "__main__":
    main()
