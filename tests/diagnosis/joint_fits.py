"""A diagnosis put together by hand from two fits, of runs whose truth is known: quick, and the same every time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dbbstation.calibration.checks.scatter import misfit_of
from dbbstation.calibration.fit.calibrate import calibrate, default_sources
from dbbstation.diagnosis.findings import Diagnosis, SourceFinding, Unexplained
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.inference.folds import HeldOut
from dbbstation.inference.levels import DifferenceFound, Differs, Levels, Verdict
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import sources_named
from dbbstation.virtual.truth import random_kinematics
from studies.virtual_session import draw_session
from tests.plant.plan import ALL

PLAY_UM, DRIFT_UM, CONSTANT_S = 4.0, 3.0, 1800.0

VALUES = {
    "backlash": np.full(6, PLAY_UM),
    "bar-drift": np.array([DRIFT_UM, CONSTANT_S, 0.0]),
    "gravity": np.array([9.7]),
}


def joint_fit(machine, names, noise_mm=3e-4, *, unexplained=None, tests=ALL):
    """Diagnosis of fifteen circles, or those of `tests`, on a machine with these sources, found where nothing is left unexplained."""
    sources = sources_named(names)
    truth = MachineModel(
        machine,
        (
            *random_kinematics(machine, 5),
            *(Fitted(s, VALUES[s.name], "bar" * (s.name == "bar-drift")) for s in sources),
        ),
    )
    plan = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")
    plan = replace(plan, tests={name: test for name, test in plan.tests.items() if name in tests})
    runs = draw_session(truth, plan, np.random.default_rng(7), noise_mm, 360)
    before = calibrate(machine, runs)
    after = before
    if unexplained is None and sources:
        after = calibrate(machine, runs, [*default_sources(), *sources], {name: VALUES[name] for name in names})
    return Diagnosis(
        mismatch=bool(sources),
        misfit=misfit_of(before),
        left=misfit_of(after),
        before=before,
        after=after,
        held_out=(HeldOut(5e-3, 3.0), HeldOut(4e-4, 1.0)),
        held_out_worse=None,
        levels=Levels(
            DifferenceFound(
                answer=Differs.YES if sources else Differs.NO,
                why="",
                probability=1.0 if sources else 0.0,
                matters=1e-3,
                matters_stated=False,
                independent_samples=900.0,
                detectable=(),
            ),
            follows=(),
            correction=None,
        ),
        outliers=(),
        workspace=None,
        locations=(),
        sources=tuple(
            SourceFinding(
                name=s.name,
                verdict=Verdict.IDENTIFIED,
                ambiguous_with=(),
                gain=9.0,
                concealed=0.5,
                probability=1.0,
                text="",
            )
            for s in sources
        )
        if after is not before
        else (),
        unexplained=unexplained or Unexplained(0.0, None, None, 0.0, "Nothing is left beyond noise."),
        shifts=(),
        second_start_agrees=True,
        next_tests=(),
    )
