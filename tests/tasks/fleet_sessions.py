"""Small sessions of several machines."""

from __future__ import annotations

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
