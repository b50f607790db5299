"""What NC tests share: the fifteen circles and a machine with drawn errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.machine.geometry import Machine
from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.dialect import Dialect
from dbbstation.nc.registry import dialect_named
from dbbstation.plan.plan import Circle, Plan
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources


@pytest.fixture(scope="session")
def table2() -> Plan:
    return read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")


@pytest.fixture(scope="session")
def all_runs(table2: Plan) -> list[Circle]:
    return [test.run(direction) for test in table2.tests.values() for direction in test.directions]


@pytest.fixture(scope="session")
def linuxcnc() -> Dialect:
    return dialect_named("linuxcnc")


@pytest.fixture(scope="session")
def crooked(reference: Machine) -> MachineModel:
    """Joint errors of 0.2 mm and strut errors of 0.1 mm, as a real machine has after assembly.

    It accelerates so fast that no feed is lost in short pieces: what keeps the feed has tests of its own.
    """
    drawn = np.random.default_rng(24)
    sources = known_sources()
    struts = Fitted(sources["strut-reference-length"], drawn.normal(0.0, 0.1, 6))
    joints = Fitted(sources["base-joints"], drawn.normal(0.0, 0.2, 18))
    return MachineModel(replace(reference, acceleration_mm_s2=50_000.0), (struts, joints))
