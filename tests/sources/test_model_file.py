"""Every error source goes into a model file and comes back as it was."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.model import read_model, write_model
from dbbstation.files.places import shipped_folder
from dbbstation.model.identified import IdentifiedModel
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted, Owner
from dbbstation.sources.registry import known_sources
from tests.sources.runs import random_run

SOURCES = list(known_sources().values())
SOURCES += [law for source in SOURCES for law in source.other_laws()]


@pytest.mark.parametrize("source", SOURCES, ids=lambda s: f"{s.name} by {s.varies_with}")
def test_a_source_survives_the_model_file(tmp_path, rng, source):
    machine = read_machine(shipped_folder("fixtures") / "machines" / "every-key.yaml")
    parameters = source.parameters(machine)
    shared = "" if source.belongs_to is Owner.MACHINE else source.shared_by(random_run(rng))
    values = np.array([rng.uniform(0.5, 2) * p.plausible for p in parameters])
    rows = tuple((source.name, shared, p.name) for p in parameters)
    model = IdentifiedModel(
        MachineModel(machine, (Fitted(source, values, shared),)), rows, np.diag([p.plausible**2 for p in parameters])
    )
    write_model(tmp_path / "model.yaml", model)
    read = read_model(tmp_path / "model.yaml", known_sources())
    (fitted,) = read.model.sources
    assert (type(fitted.source), fitted.shared) == (type(source), shared)
    assert np.array_equal(fitted.values, values)
    assert read.covariance_rows == rows
    assert np.array_equal(read.covariance, model.covariance)
