"""Four reports whose first pages say different things: all is well, a tolerance is exceeded, the model failed, not a certificate."""

from __future__ import annotations

import json

import numpy as np

from dbbstation.cli import DONE
from tests.cli.conftest import call
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.noise import Noise
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record

PLACE = "hall 3"
TESTS = "abdg"
"""Enough that a calibration finds gravity missing."""

LIMITS = (
    "{quantity: circular-deviation, largest: 8, unit: µm}",
    "{quantity: centre-deviation, largest: 15, unit: µm}",
    "{quantity: mean-radial-error, largest: 10, unit: µm}",
    "{quantity: radial-deviation, largest: 8, unit: µm, filter: 50}",
    "{quantity: bidirectional-circular-deviation, largest: 8, unit: µm}",
    "{quantity: mean-bidirectional-radial-deviation, largest: 10, unit: µm}",
    "{quantity: circular-hysteresis, largest: 2, unit: µm, filter: 15}",
)
"""One for every figure that may have a tolerance."""

KNOWN = """operator: A. Mori
job: spindle exchanged, order 4711
serial_number: HX-0017
ambient_temp_c: 20.0
bar: {serial_number: DBB-0042, calibrator_serial_number: B-7, calibrator_certificate: D-K-15018-01, calibrator_certified: 2026-03-02, calibrator_valid_until: 2027-03-02, calibrated_length_mm: 150.0, calibrator_uncertainty_mm: 0.0005, calibrated: 2026-11-20T07:30:00Z,
  temp_c: 20.0, expansion_um_m_k: 1.2}
"""


def settings_in(folder):
    path = folder / "settings.yaml"
    path.write_text("format: dbb-settings/1\ntolerances:\n" + "".join(f"  - {one}\n" for one in LIMITS), "utf-8")
    return path


def complete(folder):
    path = folder / "session.yaml"
    head, runs = path.read_text("utf-8").split("runs:\n")
    kept = [line for line in head.splitlines() if line.partition(":")[0] in {"machine", "plan"}]
    path.write_text("\n".join(["format: dbb-session/1", *kept, KNOWN]) + "runs:\n" + runs, "utf-8")
    outcome = call("session", "seal", folder)
    assert outcome.code == DONE, outcome.err
    return folder


def four_reports(folder):
    """Write the four reports, page and numbers of each, named by what it shows."""
    rng = np.random.default_rng(35)
    errors = Kinematics(length_mm=rng.normal(0.0, 0.03, 6), base_mm=rng.normal(0.0, 0.05, (6, 3)))
    plan, quiet = subset(table_ii_plan(4), list(TESTS)), Noise(white_um=0.3)
    few = subset(table_ii_plan(4), ["a", "b"])
    record(folder / "sound", seed=5, plan=few, noise=quiet, rate_hz=10.0)
    record(folder / "bent", seed=4, plan=plan, mechanisms=[errors, Gravity(9e-6)], noise=quiet, rate_hz=10.0)
    record(folder / "bare", seed=5, plan=few, noise=quiet, rate_hz=10.0)
    sound, bent = complete(folder / "sound"), complete(folder / "bent")
    calibrated = call("calibrate", bent, "--out", folder / "kinematic.yaml")
    assert calibrated.code == DONE, calibrated.err
    diagnosed = call("diagnose", bent, "--sources", "gravity", "--no-held-out", "--out", folder / "joint.yaml")
    assert diagnosed.code == DONE, diagnosed.err
    asked = {
        "well": [sound, "--place", PLACE, "--certificate"],
        "exceeded": [bent, "--place", PLACE, "--model", folder / "joint.yaml"],
        "failed": [bent, "--place", PLACE, "--model", folder / "kinematic.yaml"],
        "bare": [folder / "bare"],
    }
    settings = settings_in(folder)
    for name, words in asked.items():
        out = folder / f"{name}.html"
        outcome = call("--settings", settings, "report", *words, "--page", out, "--json")
        assert outcome.code == DONE, outcome.err
        out.with_suffix(".json").write_text(outcome.out, encoding="utf-8")


def read_reports(folder):
    return {
        page.stem: (page, json.loads(page.with_suffix(".json").read_text("utf-8"))) for page in folder.glob("*.html")
    }
