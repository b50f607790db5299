"""What is released works without the checkout: the sdist builds the wheel, which does the whole job from an empty folder."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import pytest

import releasing
from tests.released import BUILDS, installed, quick_demo, run, wheel

__all__ = ["installed", "quick_demo", "wheel"]

LARGEST_MB = 2.0

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not BUILDS, reason="this environment has no pip to build with"),
]


def test_a_second_build_has_the_same_bytes(wheel, tmp_path):
    for again in releasing.built(tmp_path):
        assert again.read_bytes() == (wheel.parent / again.name).read_bytes()


def shipped(installed, folder, name):
    script = f"from dbbstation.files.places import shipped_folder; print(shipped_folder({name!r}))"
    return Path(run(installed, folder, "python", "-c", script).stdout.strip())


def test_what_is_in_it(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert "dbbstation/protocols/plans/table2.yaml" in names
    assert "dbbstation/fixtures/machines/reference.yaml" in names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert [name for name in names if name.startswith(("tests/", "docs/", "protocols/", "fixtures/"))] == []
    assert [name for name in names if name.endswith((".nbi", ".nbc", ".pyc"))] == []
    assert {name.split("/sessions/")[1].split("/")[0] for name in names if "/sessions/" in name} == {"small"}
    assert wheel.stat().st_size < LARGEST_MB * 1e6


def test_it_checks_a_plan_that_it_ships(installed, tmp_path):
    protocols = shipped(installed, tmp_path, "protocols")
    assert protocols.is_relative_to(installed.parent)
    done = run(installed, tmp_path, "dbbstation", "check", protocols / "plans" / "table2.yaml")
    assert (done.returncode, done.stderr) == (0, "")
    assert "15 tests" in done.stdout


def test_it_knows_its_instruments(installed, tmp_path):
    done = run(installed, tmp_path, "dbbstation", "instrument", "list")
    assert (done.returncode, done.stderr) == (0, "")
    assert "heidenhain-nd281b" in done.stdout
    assert list(tmp_path.iterdir()) == []


EVERYTHING = """
import importlib, pkgutil, dbbstation
for module in pkgutil.walk_packages(dbbstation.__path__, "dbbstation."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
print(dbbstation.__version__, dbbstation.__file__)
"""


def test_every_module_of_it_is_imported(installed, tmp_path):
    done = run(installed, tmp_path, "python", "-c", EVERYTHING)
    assert done.returncode == 0, done.stderr
    version, place = done.stdout.split(maxsplit=1)
    assert version == releasing.VERSION
    assert Path(place.strip()).is_relative_to(installed.parent)


def test_it_does_the_whole_job(quick_demo):
    """Its numbers are looked at in tests/test_demo.py."""
    assert (quick_demo.job / "report.html").is_file()
    assert json.loads(quick_demo.out)["runs"]
