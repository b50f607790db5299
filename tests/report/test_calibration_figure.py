"""The figure of a calibration: well-formed, the same bytes each time, every part in it; round numbers of its keys."""

from __future__ import annotations

import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.report.calibration_figure import calibration_figure
from dbbstation.virtual.truth import random_kinematics
from studies.virtual_session import draw_session


@pytest.fixture(scope="module")
def fit(reference):
    plan = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")
    truth = MachineModel(reference, random_kinematics(reference, 5))
    return calibrate(reference, draw_session(truth, plan, np.random.default_rng(3), 3e-4, 360))


def test_every_part_is_drawn_and_drawn_alike(fit):
    drawn = calibration_figure(fit)
    texts = ["".join(t.itertext()).strip() for t in ET.fromstring(drawn).iter("{http://www.w3.org/2000/svg}text")]  # noqa: S314 - our own
    assert len([text for text in texts if ": circularity " in text]) == 15
    assert {"left within mountings, CCW", "left within mountings, CW", "leverage of each test"} <= set(texts)
    assert {"centres off the balls, nominal machine", "centres off the balls, calibrated"} <= set(texts)
    assert {"Z -1150 mm", "Z -1008 mm", "Z -870 mm"} <= set(texts)
    assert {"2 × 0.99 µm stated", "2 × 2.02 µm stated"} <= set(texts)  # hypot of 0.58 or 1.85 and 0.8
    assert calibration_figure(fit) == drawn
    # Paths are shortened and frames renamed after drawing: both must still be what they were.
    named = set(re.findall(rb' id="([^"]+)"', drawn))
    assert set(re.findall(rb"url\(#([^)]+)\)", drawn)) | set(re.findall(rb'href="#([^"]+)"', drawn)) <= named
    paths = re.findall(rb' d="([^"]*)"', drawn)
    assert len(paths) > 1000
    assert all(re.fullmatch(rb"\s*(?:[MLQClz]\s*|-?\d*(?:\.\d{1,2})?(?:e-\d+)?\s*)*", path) for path in paths)
