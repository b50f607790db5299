"""Runs averaged over sectors: sharp effects are means over the samples, as readings of the independent plant are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.diagnosis.diagnose import thinned
from dbbstation.inference.bounds import BOUNDS
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.causes.backlash import Backlash
from dbbstation.sources.causes.screw_cyclic import ScrewCyclic
from dbbstation.sources.contract import Fitted
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.backlash import Backlash as PlayOfPlant
from tests.plant.mechanisms.screw import ScrewCyclic as ScrewOfPlant
from tests.plant.noise import Noise
from tests.plant.plan import Path, subset, table_ii_plan
from tests.plant.session import record

GAPS_UM = (2.0, 3.0, 4.0, 5.0, 6.0, 7.0)
WAVES_UM = np.array([3.0, 2.0, 4.0, 3.0, 5.0, 2.0])
PHASES_DEG = np.array([0.0, 60.0, 130.0, 200.0, 250.0, 310.0])
SINES_COSINES_UM = np.column_stack(
    [WAVES_UM * np.cos(np.radians(PHASES_DEG)), WAVES_UM * np.sin(np.radians(PHASES_DEG))]
)


def recorded_by(folder, mechanism, rate_hz):
    plan = subset(table_ii_plan(7, Path(150.0, 1500.0)), "a")
    record(folder, seed=7, plan=plan, mechanisms=[mechanism], setup=(), noise=Noise(0.0), rate_hz=rate_hz)
    return load_sessions([folder])


@pytest.mark.parametrize(
    ("mechanism", "fitted", "rate_hz", "times"),
    [
        pytest.param(PlayOfPlant(GAPS_UM), Fitted(Backlash(), np.array(GAPS_UM)), 25.0, 4.0, id="a step, two samples"),
        pytest.param(
            PlayOfPlant(GAPS_UM), Fitted(Backlash(), np.array(GAPS_UM)), 150.0, 2.0, id="a step, eight samples"
        ),
        pytest.param(
            ScrewOfPlant(tuple(WAVES_UM), tuple(PHASES_DEG)),
            Fitted(ScrewCyclic(), SINES_COSINES_UM.ravel()),
            25.0,
            1.5,
            id="a wave of 5 mm",
        ),
    ],
)
def test_readings_of_sectors_are_means_of_the_effect(tmp_path, mechanism, fitted, rate_hz, times):
    recorded = recorded_by(tmp_path / "s", mechanism, rate_hz)
    model = MachineModel(recorded.machine, (fitted,))
    of_samples, of_means = [], []
    for run in map(thinned, recorded.observations):
        assert len(run.raw) <= 720
        assert len(run.finer[0].raw) <= BOUNDS.samples_of_sharp * len(run.raw)
        for one, found in ((run, of_samples), (replace(run, finer=None), of_means)):
            found.append(1e3 * (model.bar(one.motion()).length_mm - run.raw.length_mm))
    off_um, unlike_um = (np.sqrt(np.mean(np.square(np.concatenate(found)))) for found in (of_samples, of_means))
    # Readings are written to a tenth of a micrometre.
    assert off_um < 0.03
    assert unlike_um > times * off_um
