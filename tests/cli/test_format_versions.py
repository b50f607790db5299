"""Every format has version 1; files of before the first release are refused with the commit that reads them."""

from __future__ import annotations

import re

import pytest

from dbbstation.errors import InputError
from dbbstation.files.checking import SCHEMAS
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from tests.files.formats.test_schemas import EXAMPLES


@pytest.mark.parametrize("name", EXAMPLES)
def test_every_format_begins_at_one_and_its_examples_are_read(run, name):
    assert name.endswith("/1")
    for file in (one for one in EXAMPLES[name] if one.stem != "tank-fmu"):  # its FMU is built by tests
        assert f"format: {name}\n" in file.read_text(encoding="utf-8")
        path = file.parent if file.name == "session.yaml" else file
        outcome = run("check", path, "--json")
        assert outcome.code == 0, outcome.err
        assert outcome.data["files"][0]["format"] == name


@pytest.mark.parametrize("name", SCHEMAS)
def test_another_version_is_refused_with_the_program_that_reads_it(run, tmp_path, name):
    file = EXAMPLES[name][0]
    other = tmp_path / file.name
    other.write_text(file.read_text(encoding="utf-8").replace(name, name.replace("/1", "/7")), encoding="utf-8")
    outcome = run("calibrate" if name == "dbb-session/1" else "check", tmp_path if name == "dbb-session/1" else other)
    assert outcome.code == 1
    fault = rf"{file.name}:\d+:\d+: `{name[:-1]}7` is a version that this program does not know; it reads {name}; .*commit [0-9a-f]{{8}}"
    assert re.search(fault, outcome.err), outcome.err


def test_a_plan_of_a_later_program_may_be_read_by_that(tmp_path):
    plan = tmp_path / "plan.yaml"
    shipped = (shipped_folder("protocols") / "plans" / "table2.yaml").read_text(encoding="utf-8")
    plan.write_text(shipped.replace("dbb-plan/1", "dbb-plan/2"), encoding="utf-8")
    with pytest.raises(InputError, match="a newer dbbstation may read the file"):
        read_plan(plan)
