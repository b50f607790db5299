"""Fleets on a Dask scheduler: what a second worker gains, and what a task costs beside its work.

    python benchmarks/fleet.py [--sessions 8] [--json]

A scheduler and its workers are started on loopback, each a process of its own with one thread. The simulated machine of the tests records
sessions of thirty runs at 10 Hz (fifteen circles of [CAL Table II] in both directions, gravity at work); `fleet --task calibrate` works on them
with one worker, then with two. Before each, the workers have loaded what they need. The time of a task beside its work is that of three
hundred tasks that do next to nothing less that of one, best of three, with one worker and with one process of this computer.
"""

from __future__ import annotations

import os
import sys
import tempfile
from functools import partial
from pathlib import Path

from benchmarks.measuring import Row, show, timed_once  # isort: skip - sets up the environment

from dbbstation.tasks.executors import WorkPool
from dbbstation.tasks.fleet import fleet
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.session import record
from tests.tasks.pieces import squared
from tests.tasks.test_executors import Cluster

SEED = 100
SESSIONS = 8
TASKS = 300


def main() -> None:
    """Measure and print."""
    count = next((int(sys.argv[k + 1]) for k, word in enumerate(sys.argv[:-1]) if word == "--sessions"), SESSIONS)
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        sessions = recorded(folder / "sessions", count)
        (folder / "cluster").mkdir()
        with Cluster(folder / "cluster") as cluster:  # type: ignore[no-untyped-call] # tests have no types
            address = cluster.address
            cluster.add_worker()
            calibrated(sessions[:2], folder / "first", address)  # loads what it needs
            one = timed_once(partial(calibrated, sessions, folder / "one", address))
            of_scheduler = of_a_task(WorkPool(1, address))
            cluster.add_worker()
            calibrated(sessions[:4], folder / "second", address)
            two = timed_once(partial(calibrated, sessions, folder / "two", address))
        of_pool = of_a_task(WorkPool(1))
    load = ", ".join(f"{one:.1f}" for one in os.getloadavg())
    rows = [
        Row("calibrations, one worker", one, "s", f"{count} sessions"),
        Row("calibrations, two workers", two, "s", f"{one / two:.2f} times as fast"),
        Row("a task beside its work, scheduler", 1e3 * of_scheduler, "ms", f"{TASKS} tasks"),
        Row("a task beside its work, processes here", 1e3 * of_pool, "ms", f"{TASKS} tasks"),
    ]
    show("a fleet on a Dask scheduler", rows, f"{os.cpu_count()} cores, load {load}")


def recorded(folder: Path, count: int) -> list[Path]:
    """Make sessions of one kind of machine."""
    sessions = [folder / f"s{k:02d}" for k in range(count)]
    for k, session in enumerate(sessions):
        errors = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.1)
        record(session, seed=SEED + k, mechanisms=[errors, Gravity()], rate_hz=10.0)
    return sessions


def calibrated(sessions: list[Path], out: Path, address: str) -> None:
    """Calibrate all sessions, on a scheduler or here."""
    found = fleet(sessions, "calibrate", out, scheduler=address)
    if found.failed:
        raise SystemExit(found.failed[0].problem)


def of_a_task(pool: WorkPool[tuple[int, str], tuple[int, int]]) -> float:
    """Time of a task that has nothing to do [s]: what many take more than one, divided by how many more they are."""

    def done(count: int) -> None:
        list(pool.each(squared, [(k, "") for k in range(count)]))

    done(1)
    one, many = (min(timed_once(partial(done, count)) for _ in range(3)) for count in (1, TASKS))
    return (many - one) / (TASKS - 1)


if __name__ == "__main__":
    main()
