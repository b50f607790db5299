"""Directions that recordings do not show, against distances of joints."""

from __future__ import annotations

import numpy as np

from dbbstation.calibration.fit.directions import in_words
from dbbstation.calibration.layout import Layout, ParameterSet
from dbbstation.inference.square_root import Columns
from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.registry import sources_named


def test_a_joint_moved_along_its_strut_lengthens_it(reference):
    """The direction is the gradient of the distance between a strut's joints, the platform in the middle of its travel."""
    strut, step_mm = 2, 1e-3
    middle = np.array([0.0, 0.0, np.mean(reference.travel.z_mm)])

    def length_mm(base_mm):
        return np.linalg.norm(reference.hexapod.platform_joints_mm[strut] + middle - base_mm)

    base_mm = reference.hexapod.base_joints_mm[strut]
    shorter = [length_mm(base_mm - step) - length_mm(base_mm + step) for step in step_mm * np.eye(3)]
    held = np.zeros(4 * STRUTS)
    held[strut] = 1.0
    held[STRUTS + 3 * strut :][:3] = np.array(shorter) / (2.0 * step_mm)
    sources = sources_named(["strut-reference-length", "base-joints"])
    columns = slice(STRUTS), slice(STRUTS, 4 * STRUTS)
    terms = [ParameterSet(one, "", one.parameters(reference), k) for one, k in zip(sources, columns, strict=True)]
    known = Columns(np.full(len(held), np.inf), np.ones(len(held)), np.zeros(len(held), dtype=bool))
    layout = Layout(reference, tuple(terms), known, np.zeros(len(held)))
    assert in_words(layout, held[None]) == ("base joint 3 along its strut together with that strut's length",)
