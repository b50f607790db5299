"""Make sessions to compare, of the independent plant: `python -m tests.diagnosis.make_pairs FOLDER`.

`before` and `same` are of one machine, balls put up anew. In `longer` strut 3 is half a micrometre longer, which is little; in
`slack` all struts have new play and give way under the platform.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.plan import table_ii_plan
from tests.plant.session import record

LONGER_MM = 5e-4
GAP_UM = 4.0
COMPLIANCE_MM_N = 9.68e-6
RATE_HZ = 25.0


def make(folder: Path) -> None:
    """Four sessions of Table II."""
    rng = np.random.default_rng(3)
    length_mm, base_mm = rng.normal(0, 0.05, 6), rng.normal(0, 0.1, (6, 3))
    geometry = Kinematics(length_mm=length_mm, base_mm=base_mm)
    longer = Kinematics(length_mm=length_mm + LONGER_MM * (np.arange(6) == 2), base_mm=base_mm)
    sessions = {
        "before": [geometry],
        "same": [geometry],
        "longer": [longer],
        "slack": [geometry, Gravity(COMPLIANCE_MM_N), Backlash((GAP_UM,) * 6)],
    }
    for seed, (name, mechanisms) in enumerate(sessions.items(), start=1):
        record(folder / name, seed=seed, plan=table_ii_plan(1), mechanisms=mechanisms, rate_hz=RATE_HZ)


if __name__ == "__main__":
    make(Path(sys.argv[1]))
