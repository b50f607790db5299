"""The whole chain: a virtual machine, a serial line, the station, its files, the calibration: errors go in, errors come out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.calibration.fit.calibrate import KINEMATIC_SOURCES, calibrate
from dbbstation.files.places import shipped_folder
from dbbstation.tasks.load import load_sessions
from tests.station.bench import bench

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.nightly  # the demonstration does it too, over the same line: tests/test_demo.py
def test_calibrating_what_was_recorded_gives_back_the_errors_of_the_machine(tmp_path: Path) -> None:
    plan_file = tmp_path / "plan.yaml"
    text = (shipped_folder("protocols") / "plans" / "table2-elevated.yaml").read_text(encoding="utf-8")
    plan_file.write_text(text.replace("directions: [ccw, cw]", "directions: [ccw]"), encoding="utf-8")
    out = tmp_path / "session"
    with bench(plan_file, scale=50.0, rate_hz=50.0, seed=7) as place:
        done = place.measure(out, "--bar-length-mm", "150", "--bar-uncertainty-um", "0.5")
        assert done.returncode == 0, done.stderr
        truth = {fitted.source.name: fitted.values for fitted in place.cell.machine.truth.sources}
    recorded = load_sessions([out])
    found = calibrate(recorded.machine, recorded.observations)
    assert (found.parameters_identified, found.directions_lost) == (24, ())
    terms = [term for term in found.layout.terms if term.source.name in KINEMATIC_SOURCES]
    columns = np.concatenate([np.r_[term.columns] for term in terms])
    off = found.solution.x[columns] - np.concatenate([truth[term.source.name] for term in terms])
    covariance = found.solution.covariance[np.ix_(columns, columns)]
    sigmas = np.abs(off) / np.sqrt(np.diag(covariance))
    assert sigmas.max() < 4.0
    # 24 independent directions: their sum of squares is chi-squared with 24 degrees of freedom, 51 at 1 in 1000.
    assert off @ np.linalg.solve(covariance, off) < 60.0
    # What is left is the noise that the virtual instrument was given, 0.3 µm, and what the clock adds to it.
    assert 1e3 * found.noise.sigma < 0.6
