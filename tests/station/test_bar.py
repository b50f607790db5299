"""The bar on its calibrator: read over the line, kept in a file, required where places are measured, known to the fit."""

from __future__ import annotations

import math
import re
import shutil
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.errors import InputError
from dbbstation.files.formats.bar import read_bar
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.session import read_session
from dbbstation.files.yaml.text import load_yaml
from dbbstation.instrument.library import load_instrument
from dbbstation.plan.bar import Bar
from dbbstation.station.bar_known import check_bar_known
from dbbstation.virtual.wire import VirtualInstrument
from tests.cli.conftest import call
from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record
from tests.station.bench import MACHINE_FILE, SHORT_PLAN, bench

if TYPE_CHECKING:
    from dbbstation.plan.plan import Plan

NOW = datetime(2026, 11, 20, 8, 0, tzinfo=UTC)
BAR = Bar("DBB-0042", 150.0003, 0.0003, NOW, 20.0, 10.0, 10.0, 150.0023, 0.3, "ZB-17")
PLATE = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")
UNDER_SPINDLE = read_plan(shipped_folder("protocols") / "plans" / "conventional.yaml")
CALIBRATOR = ["--calibrator-serial", "ZB-17", "--calibrator-mm", "150.0003", "--calibrator-u-um", "0.25"]
CALIBRATOR += ["--certified", "2026-03-01", "--temp-c", "20.3", "--bar-serial-number", "DBB-0042"]


def test_the_bar_is_read_from_an_instrument_and_kept(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    protocol = load_instrument("streaming-encoder")
    out = tmp_path / "bar.yaml"
    with VirtualInstrument(protocol, lambda _t: 150.0023 + rng.normal(0.0, 0.0004)) as wire:
        told = call(
            "bar", "--instrument", "streaming-encoder", "--port", wire.port, *CALIBRATOR, "--out", out, "--json"
        )
        again = call("bar", "--instrument", "streaming-encoder", "--port", wire.port, *CALIBRATOR, "--out", out)
        old = call(
            "bar", "--instrument", "streaming-encoder", "--port", wire.port, *CALIBRATOR, "--certified", "2012-03-02",
            "--out", tmp_path / "old.yaml",
        )  # fmt: skip
    assert "`measure` refuses this bar: the calibrator was certified on 2012-03-02" in old.err
    assert "refuses" not in told.err
    assert told.code == 0, told.err
    bar = read_bar(out)
    # Two hundred independent readings: 0.4 µm / sqrt(200) = 0.03 µm about the true mean, five of them are never seen.
    assert bar.readings.mean_mm == pytest.approx(150.0023, abs=5 * 0.0004 / math.sqrt(200))
    assert bar.readings.scatter_um == pytest.approx(0.4, rel=0.25)
    assert told.data["reads_long_um"] == pytest.approx(2.0, abs=0.15)
    assert told.data["standard_uncertainty_um"] == pytest.approx(math.hypot(0.25, bar.readings.uncertainty_um))
    assert (bar.serial_number, bar.calibrator.serial_number, bar.calibrator.certified) == (
        "DBB-0042",
        "ZB-17",
        "2026-03-01",
    )
    assert (again.code, "exists already" in again.err) == (1, True)
    checked = call("check", out)
    assert checked.code == 0
    assert re.search(r"bar DBB-0042: reads \+[12]\.\d\d µm long, standard uncertainty 0\.2\d µm", checked.out)


def test_the_bar_of_the_emulator_shows_its_error_on_the_calibrator(tmp_path: Path) -> None:
    plan_file = tmp_path / "plan.yaml"
    plan_file.write_text(SHORT_PLAN, encoding="utf-8")
    with bench(plan_file, scale=1.0) as place:
        place.cell.calibrate(150.0003)
        wire = ["--instrument", place.instrument, "--port", place.wire.port]
        told = call("bar", *wire, *CALIBRATOR, "--count", "40", "--out", tmp_path / "bar.yaml", "--json")
        true_um = 1e3 * place.cell.machine.bar_error_mm
    assert told.code == 0, told.err
    assert told.data["reads_long_um"] == pytest.approx(true_um, abs=5 * told.data["scatter_um"] / math.sqrt(40) + 0.1)


def test_an_instrument_that_shows_nothing_makes_no_file(tmp_path: Path) -> None:
    with VirtualInstrument(load_instrument("streaming-encoder"), lambda _t: None) as wire:
        told = call(
            "bar", "--instrument", "streaming-encoder", "--port", wire.port, *CALIBRATOR, "--count", "20",
            "--out", tmp_path / "bar.yaml",
        )  # fmt: skip
    assert told.code == 1
    assert "put the bar on the calibrator" in told.err
    assert not (tmp_path / "bar.yaml").exists()


def test_a_display_that_was_not_preset_is_refused_by_the_file(tmp_path: Path) -> None:
    text = (shipped_folder("fixtures") / "bars" / "zerodur.yaml").read_text(encoding="utf-8")
    file = tmp_path / "bar.yaml"
    file.write_text(text.replace("mean_mm: 150.00052", "mean_mm: 148.5"), encoding="utf-8")
    with pytest.raises(InputError, match="preset the display to the calibrator's length"):
        read_bar(file)


@pytest.mark.parametrize(
    ("bar", "why"),
    [
        (None, "nobody has read the bar on its calibrator"),
        (replace(BAR, reading_mm=None), "nobody has read the bar on its calibrator"),
        (replace(BAR, calibrated=NOW - timedelta(hours=25)), "on its calibrator 25 h ago, 24 h are allowed"),
        (replace(BAR, calibrated=NOW + timedelta(hours=1)), "of the future"),
        (replace(BAR, calibrated=NOW.replace(year=1996)), "262968 h ago"),  # 30 years, of which 7 leap years
    ],
)
def test_places_on_a_plate_need_a_bar_that_was_read_lately(bar: Bar | None, why: str) -> None:
    with pytest.raises(InputError, match=why):
        check_bar_known(bar, PLATE, NOW)
    check_bar_known(bar, UNDER_SPINDLE, NOW)
    check_bar_known(BAR, PLATE, NOW)


@pytest.mark.parametrize(
    ("certified", "valid_until", "why"),
    [
        ("2012-03-02", None, "certified on 2012-03-02; without a stated last day its certificate holds for five years"),
        ("2012-03-02", "2096-03-02", ""),
        ("2096-03-02", None, "certified on 2096-03-02"),
        ("2026-03-02", "2026-11-18", "valid until 2026-11-18"),
        ("2026-03-02", f"{NOW:%Y-%m-%d}", ""),
    ],
)
@pytest.mark.parametrize("plan", [PLATE, UNDER_SPINDLE])
def test_a_calibrator_whose_certificate_does_not_hold_is_refused(
    plan: Plan, certified: str, valid_until: str | None, why: str
) -> None:
    bar = replace(BAR, calibrator_certified=certified, calibrator_valid_until=valid_until)
    if not why:
        check_bar_known(bar, plan, NOW)
        return
    with pytest.raises(InputError, match=why):
        check_bar_known(bar, plan, NOW)


@pytest.mark.parametrize("option", ["--operator", "--job", "--serial-number"])
def test_a_blank_name_is_refused(tmp_path: Path, option: str) -> None:
    words = ["measure", "--plan", shipped_folder("protocols") / "plans" / "table2.yaml", "--machine", MACHINE_FILE]
    words += ["--instrument", "heidenhain-nd281b", "--port", "no-port", "--out", tmp_path / "s", option, "  "]
    refused = call(*words)
    assert f"{option} is blank" in refused.err
    assert not (tmp_path / "s").exists()


def test_the_shop_sets_the_age(tmp_path: Path) -> None:
    check_bar_known(replace(BAR, calibrated=NOW - timedelta(hours=99)), PLATE, NOW, largest_age_h=100.0)
    settings = tmp_path / "own.yaml"
    settings.write_text("format: dbb-settings/1\nlimits: {largest_bar_age_h: 1}\n", encoding="utf-8")
    bar = (shipped_folder("fixtures") / "bars" / "zerodur.yaml").read_text(encoding="utf-8")
    then = datetime.now(UTC) - timedelta(hours=2)
    file = tmp_path / "bar.yaml"
    file.write_text(bar.replace("2026-11-20T07:40:00Z", f"{then:%Y-%m-%dT%H:%M:%SZ}"), encoding="utf-8")
    words = ["measure", "--plan", shipped_folder("protocols") / "plans" / "table2.yaml", "--machine", MACHINE_FILE]
    words += ["--instrument", "heidenhain-nd281b", "--port", "no-port", "--out", tmp_path / "s", "--bar", file]
    refused = call(*words, "--settings", settings)
    assert "2 h ago, 1 h are allowed" in refused.err
    assert "--bar-waiver" in refused.err
    assert not (tmp_path / "s").exists()
    assert "no-port" in call(*words).err  # within a day: as far as the port that is not there


def test_what_the_bar_reads_too_long_by_hand() -> None:
    """2 µm on its calibrator; 150.0003 mm of 10 µm/(m K) grow by 1.5 µm a kelvin, and the gauge travels less by that."""
    assert BAR.reads_long_mm(None) == (pytest.approx(0.002), 0.0003)
    long_mm, uncertainty_mm = BAR.reads_long_mm(22.0)
    assert long_mm == pytest.approx(0.002 - 0.003, abs=1e-8)
    of_temperature = math.hypot(math.sqrt(2.0) * 0.3, 0.05 * 2.0)  # two temperatures, and a coefficient known to 5 %
    assert uncertainty_mm == pytest.approx(math.hypot(0.0003, 0.0015 * of_temperature), rel=1e-4)
    # A known effect is corrected whether its uncertainty is stated or not: then it is the usual one.
    assert replace(BAR, temp_uncertainty_k=None).reads_long_mm(22.0)[0] == long_mm
    assert replace(BAR, temp_c=None).reads_long_mm(22.0) == BAR.reads_long_mm(None)
    assert BAR.lacks(None) == ("temperature of bar or shop at the measurement",)
    assert replace(BAR, expansion_um_m_k=0.0, temp_c=None).lacks(None) == ()


def test_a_bar_that_reads_long_by_its_calibration_changes_no_result(tmp_path: Path) -> None:
    """The same machine, measured with a display that shows 10 µm more on every length, its calibrator's too."""
    plain, shifted = tmp_path / "plain", tmp_path / "shifted"
    errors = Kinematics(length_mm=np.array([0.03, -0.02, 0.05, 0.01, -0.04, 0.02]), base_mm=np.zeros((6, 3)))
    record(plain, seed=5, plan=subset(table_ii_plan(5), "agl"), mechanisms=[errors], rate_hz=5.0)
    shutil.copytree(plain, shifted)
    for run in (shifted / "runs").iterdir():
        rows = [line.split(",") for line in run.read_text(encoding="utf-8").splitlines()]
        at = next(row for row in rows if row[0] == "t_s").index("length_mm")
        for row in rows:
            if row[0][0].isdigit():
                row[at] = f"{float(row[at]) + 0.010:.6f}"
        run.write_text("".join(",".join(row) + "\n" for row in rows), encoding="utf-8")
    file = shifted / "session.yaml"
    text = re.sub(r", sha256: [0-9a-f]{64}", "", file.read_text(encoding="utf-8"))
    (length,) = re.findall(r"calibrated_length_mm: ([0-9.]+)", text)
    text = text.replace(
        f"calibrated_length_mm: {length}", f"calibrated_length_mm: {length}, reading_mm: {float(length) + 0.010}"
    )
    file.write_text(text.replace("dbb-session/1", "dbb-session/1"), encoding="utf-8")
    assert call("session", "seal", shifted).code == 0
    assert read_session(shifted).bar.reads_long_mm(None)[0] == pytest.approx(0.010)
    values = []
    for session in (plain, shifted):
        model = tmp_path / f"{session.name}.yaml"
        told = call("calibrate", session, "--out", model)
        assert told.code == 0, told.err
        sources = load_yaml(model, []).data["sources"]
        values.append(np.array([one["value"] for source in sources for one in source["parameters"].values()]))
    assert np.abs(values[0]).max() > 0.01
    assert np.allclose(*values, rtol=0.0, atol=2e-6)
