"""A single reading that leaves its neighbours is found, and chance does not make one."""

from __future__ import annotations

import hashlib
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from dbbstation.cli import DONE
from dbbstation.quality import limits
from dbbstation.quality.finding import FindingVerdict
from dbbstation.quality.spike import spike
from tests.cli.conftest import call
from tests.plant.noise import Noise
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record

PHI_DEG = np.arange(3600) / 10.0


def circle(residual_um, resolution_um=0.0, phi_deg=PHI_DEG):
    raw = SimpleNamespace(phi_deg=phi_deg, theta_deg=phi_deg % 360.0)
    return SimpleNamespace(residual_um=residual_um, raw=raw, noise=SimpleNamespace(resolution_um=resolution_um))


def noise(seed, sigma_um=0.4):
    return np.random.default_rng(seed).normal(0.0, sigma_um, len(PHI_DEG))


@pytest.mark.parametrize("width", [1, 2])
@pytest.mark.parametrize("height_um", [5.0, -5.0])
def test_five_micrometres_over_one_or_two_readings_are_found_with_their_place(width, height_um):
    values = noise(3)
    values[1234 : 1234 + width] += height_um
    found = spike(circle(values), ())
    assert found.verdict is FindingVerdict.WRONG
    assert abs(found.value - 5.0) < 3.0 * 0.4 * np.sqrt(2.0)
    assert found.limit < 4.0
    assert f"at {123.4:.1f} degrees" in found.text or f"at {123.5:.1f} degrees" in found.text


def test_a_form_of_the_machine_is_no_spike():
    phi = np.radians(PHI_DEG)
    form = 20.0 * np.cos(2.0 * phi) + 5.0 * np.cos(7.0 * phi) + 1.0 * np.cos(60.0 * phi)
    assert spike(circle(form + noise(4)), ()).verdict is FindingVerdict.GOOD


def test_readings_in_coarse_steps_are_no_spikes():
    for seed in range(20):
        assert spike(circle(np.round(noise(seed)), 1.0), ()).verdict is FindingVerdict.GOOD


def test_beside_a_gap_neighbours_say_nothing():
    kept = np.r_[0:1000, 1040:3600]
    values = (0.05 * PHI_DEG + noise(5))[kept]
    assert spike(circle(values, phi_deg=PHI_DEG[kept]), ()).verdict is FindingVerdict.GOOD


def test_a_spike_that_every_reversal_has_is_the_machines():
    reversals = (30.0, 90.0, 150.0, 210.0, 270.0, 330.0)
    values = noise(6)
    for at in reversals:
        values[round(10 * at)] += 5.0
    assert spike(circle(values), reversals).verdict is FindingVerdict.GOOD
    assert spike(circle(values), ()).verdict is FindingVerdict.WRONG
    values[920] += 5.0
    assert spike(circle(values), reversals).verdict is FindingVerdict.WRONG


def test_too_few_readings_cannot_tell():
    few = PHI_DEG[::60]
    assert spike(circle(np.zeros(len(few)), phi_deg=few), ()).verdict is FindingVerdict.CANNOT_TELL


@pytest.mark.parametrize("correlation", [0.0, 0.7, 0.97])
def test_false_alarms_are_not_more_than_stated(monkeypatch, correlation):
    """With two in a hundred stated in place of one in ten thousand, so that two hundred turns can show it: 4 are expected at the
    most, and 13 come by chance once in ten thousand times [Poisson]."""
    monkeypatch.setattr(limits, "SHARE", 0.02)
    rng = np.random.default_rng(17)
    wrong = 0
    for _ in range(200):
        white = rng.normal(0.0, 0.4 * np.sqrt(1.0 - correlation**2), len(PHI_DEG) + 200)
        values = np.empty_like(white)
        values[0] = white[0]
        for k in range(1, len(white)):
            values[k] = correlation * values[k - 1] + white[k]
        wrong += spike(circle(values[200:]), ()).wrong
    assert wrong < 13


def test_a_spike_in_a_recording_is_named_by_check(tmp_path: Path):
    folder = tmp_path / "session"
    record(folder, seed=5, plan=subset(table_ii_plan(5), "a"), rate_hz=50.0, noise=Noise(white_um=0.3))
    spoilt = Path(shutil.copytree(folder, tmp_path / "spoilt"))
    path = min((spoilt / "runs").glob("a-ccw-*.csv"))
    lines = path.read_text().splitlines(keepends=True)
    at = len(lines) // 2
    fields = lines[at].rstrip("\n").split(",")
    fields[1] = f"{float(fields[1]) + 0.005:.6f}"
    lines[at] = ",".join(fields) + "\n"
    path.write_text("".join(lines))
    text = (spoilt / "session.yaml").read_text()
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    name = re.escape(f"runs/{path.name}")
    (spoilt / "session.yaml").write_text(
        re.sub(rf"({name}.*?sha256: )[0-9a-f]{{64}}", rf"\g<1>{digest}", text, count=1)
    )
    outcome = call("check", spoilt)
    assert outcome.code == DONE
    assert f"{path.name}: spike: a reading stands" in outcome.err
    assert "spike: " not in call("check", folder).err
