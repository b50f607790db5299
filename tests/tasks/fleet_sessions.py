"""Small sessions of several machines, and work that ends the process in which it is done."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import numpy as np

from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record


def machines(folder, count, tests="abd", seed=36):
    """Record one session of each machine; their serial numbers are M00, M01, …"""
    rng = np.random.default_rng(seed)
    for k in range(count):
        errors = Kinematics(length_mm=rng.normal(0.0, 0.02, 6), base_mm=rng.normal(0.0, 0.02, (6, 3)))
        session = folder / f"m{k:02d}"
        plan = subset(table_ii_plan(seed + k), list(tests))
        record(session, seed=seed + k, plan=plan, mechanisms=[errors], rate_hz=10.0)
        path = session / "session.yaml"
        text = path.read_text("utf-8").replace("dbb-session/1", "dbb-session/1", 1)
        path.write_text(text.replace("ambient_temp_c:", f"serial_number: M{k:02d}\nambient_temp_c:", 1), "utf-8")
    return folder


def squared(item):
    number, _ = item
    return number**2, os.getpid()


def ends_once(item):
    """As `squared`; the first process that gets a number below zero is killed, as by a computer that runs out of memory."""
    number, folder = item
    mark = Path(folder) / "ended"
    if number < 0 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return squared(item)


def ends_always(item):
    if item[0] < 0:
        os.kill(os.getpid(), signal.SIGKILL)
    return squared(item)


def told_and_slow(item):
    """As `squared`, once it was noted that this process works on the number; slow enough to be killed meanwhile."""
    number, folder = item
    (Path(folder) / f"{number}-{os.getpid()}").touch()
    time.sleep(0.3)
    return squared(item)
