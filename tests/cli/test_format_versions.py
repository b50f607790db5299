"""Formats grow: every version stays readable, newer keys raise it, and a file says the oldest version that has its keys."""

from __future__ import annotations

import re

import pytest

from dbbstation.errors import InputError
from dbbstation.files.formats.every_format import SCHEMAS, json_schema
from dbbstation.files.formats.machine import MachineFile, read_machine
from dbbstation.files.formats.plan import PlanFile, read_plan
from dbbstation.files.recordings.session import read_session
from dbbstation.files.shipped import shipped_folder
from dbbstation.files.yaml.schema import SINCE, format_for, versions_of
from tests.plant.session import record

FIXTURES = shipped_folder("fixtures")
STORED = {
    "dbb-machine/1": FIXTURES / "machines" / "reference.yaml",
    "dbb-machine/2": FIXTURES / "machines" / "greatest-feed.yaml",
    "dbb-machine/3": FIXTURES / "machines" / "every-key.yaml",
    "dbb-jig/1": FIXTURES / "jigs" / "reference-plate.yaml",
    "dbb-job/1": FIXTURES / "jobs" / "virtual.yaml",
    "dbb-job/2": FIXTURES / "jobs" / "daily-check.yaml",
    "dbb-plan/1": shipped_folder("protocols") / "plans" / "table2.yaml",
    "dbb-plan/2": FIXTURES / "plans" / "every-key.yaml",
    "dbb-model/1": FIXTURES / "models" / "small.yaml",
    "dbb-model/2": FIXTURES / "models" / "greatest-feed.yaml",
    "dbb-model/3": FIXTURES / "models" / "provenance.yaml",
    "dbb-model/4": FIXTURES / "models" / "null-space.yaml",
    "dbb-settings/1": FIXTURES / "settings" / "version-1.yaml",
    "dbb-settings/2": FIXTURES / "settings" / "version-2.yaml",
    "dbb-settings/3": FIXTURES / "settings" / "version-3.yaml",
    "dbb-settings/4": FIXTURES / "settings" / "every-key.yaml",
    "dbb-bar/1": FIXTURES / "bars" / "zerodur.yaml",
    "dbb-simulator/1": FIXTURES / "simulators" / "pendulum.yaml",
    "dbb-mapping/1": FIXTURES / "mappings" / "version-1.yaml",
    "dbb-mapping/2": FIXTURES / "mappings" / "every-key.yaml",
    "dbb-session/1": FIXTURES / "sessions" / "under-spindle",
    "dbb-session/2": FIXTURES / "sessions" / "small",
    "dbb-session/3": FIXTURES / "sessions" / "sealed",
    "dbb-session/4": FIXTURES / "sessions" / "begun",
    "dbb-session/5": FIXTURES / "sessions" / "logged",
    "dbb-session/6": FIXTURES / "sessions" / "virtual",
}
"""One stored file of each version."""


def test_a_file_of_every_version_is_stored():
    every = {version for schema in SCHEMAS.values() for version in versions_of(schema)}
    assert set(STORED) == every


@pytest.mark.parametrize("version", STORED)
def test_it_is_read(run, version):
    path = STORED[version]
    text = (path / "session.yaml" if path.is_dir() else path).read_text(encoding="utf-8")
    assert f"format: {version}\n" in text
    outcome = run("check", path, "--json")
    assert outcome.code == 0, outcome.err
    assert outcome.data["files"][0]["format"] == version


@pytest.mark.parametrize("version", [v for v in STORED if not v.endswith("/1")])
def test_a_newer_key_in_an_older_version_is_refused_with_what_to_write(run, tmp_path, version):
    path = STORED[version]
    file = path / "session.yaml" if path.is_dir() else path
    name = version.partition("/")[0]
    older = tmp_path / file.name
    older.write_text(file.read_text(encoding="utf-8").replace(version, f"{name}/1"), encoding="utf-8")
    outcome = run("calibrate" if name == "dbb-session" else "check", older)
    assert outcome.code == 1
    keys = {key: since for key, since in SINCE[name].items() if f"{key}:" in older.read_text(encoding="utf-8")}
    assert int(version.partition("/")[2]) in keys.values()
    for key, since in keys.items():
        newer = f"{name}/{since}"
        fault = rf"{older.name}:\d+:\d+: the key `{key}` came with {newer}, and this file is {name}/1; write `format: {newer}`"
        assert re.search(fault, outcome.err), outcome.err


def test_a_version_of_the_future_says_that_a_newer_program_reads_it(tmp_path):
    text = STORED["dbb-plan/1"].read_text(encoding="utf-8")
    later = tmp_path / "plan.yaml"
    later.write_text(text.replace("dbb-plan/1", "dbb-plan/7"), encoding="utf-8")
    with pytest.raises(InputError, match=r"it reads dbb-plan/1, dbb-plan/2; a newer dbbstation reads the file"):
        read_plan(later)


def test_what_is_written_has_the_oldest_version_that_has_its_keys(tmp_path):
    assert format_for(PlanFile, {"name": "a", "tests": [{"ball": "b"}]}) == "dbb-plan/1"
    assert format_for(PlanFile, {"name": "a", "largest_loss_percent": 1.0}) == "dbb-plan/2"
    assert format_for(MachineFile, {"travel": {"greatest_feed_mm_min": 1000.0}}) == "dbb-machine/2"
    record(tmp_path / "s", seed=1, rate_hz=4.0)
    assert len(read_session(tmp_path / "s").runs) > 0
    assert read_machine(STORED["dbb-machine/2"]).greatest_feed_mm_min is not None


def test_the_schema_of_an_older_version_is_that_of_the_newest():
    assert json_schema("dbb-plan/1") == json_schema("dbb-plan/2")
    with pytest.raises(KeyError):
        json_schema("dbb-plan/3")
