"""Draw docs/images/calibration.svg and docs/images/diagnosis.svg, as `--figure` of both commands draws them.

Run from the checkout: .venv/bin/python -m docs.figures.fits

The machine is simulated by tests/plant, which shares no code with the package. Its errors are drawn with standard
deviations of 0.05 mm for struts and 0.1 mm for base joints; ball holders, CMM, bar and readings scatter. The fifteen
circles of [CAL Table II] are recorded twice: of that machine alone, which is calibrated; and with struts that gravity
stretches and drives that have play, which is diagnosed.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.diagnosis.source_curves import gains_by_test, source_curves
from dbbstation.report.calibration_figure import calibration_figure
from dbbstation.report.diagnosis_figure import diagnosis_figure
from dbbstation.tasks.load import load_sessions
from studies.diagnosed import diagnose_sessions
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.session import record

IMAGES = Path(__file__).parent.parent / "images"
CANDIDATES = ("gravity", "backlash", "thermal-struts", "bar-drift")
RATE_HZ = 20.0
SEED = 31


def main() -> None:
    """Write both images."""
    errors = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.1)
    with tempfile.TemporaryDirectory() as name:
        rigid, elastic = Path(name) / "rigid", Path(name) / "elastic"
        record(rigid, seed=SEED, mechanisms=[errors], rate_hz=RATE_HZ)
        record(elastic, seed=SEED, mechanisms=[errors, Gravity(), Backlash()], rate_hz=RATE_HZ)
        recorded = load_sessions([rigid])
        fit = calibrate(recorded.machine, recorded.observations)
        (IMAGES / "calibration.svg").write_bytes(calibration_figure(fit))
        found = diagnose_sessions([elastic], CANDIDATES, (), print).diagnosis
        (IMAGES / "diagnosis.svg").write_bytes(diagnosis_figure(found, gains_by_test(found), source_curves(found)))


if __name__ == "__main__":
    main()
