"""What is released works without the checkout: the sdist builds the wheel, which does the whole job from an empty folder.

The environment is new and takes only other packages from here; `python releasing.py try` installs them anew, too.
"""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

import releasing

CHECKOUT = Path(__file__).parents[2]
LARGEST_MB = 2.0

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(importlib.util.find_spec("pip") is None, reason="this environment has no pip to build with"),
]


def pip(*arguments):
    command = [sys.executable, "-m", "pip", *map(str, arguments), "--quiet", "--disable-pip-version-check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    files = releasing.built(folder)
    assert releasing.faults_of(files) == []
    (built,) = folder.glob("dbbstation-*.whl")
    return built


def test_a_second_build_has_the_same_bytes(wheel, tmp_path):
    for again in releasing.built(tmp_path):
        assert again.read_bytes() == (wheel.parent / again.name).read_bytes()


@pytest.fixture(scope="module")
def installed(tmp_path_factory, wheel):
    """Scripts of a new environment that has the wheel, and everything else from this environment."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=False)
    paths = sysconfig.get_paths(vars={"base": str(folder), "platbase": str(folder)})
    scripts, libraries = Path(paths["scripts"]), Path(paths["purelib"])
    python = scripts / Path(sys.executable).name
    pip("--python", python if python.exists() else scripts / "python", "install", "--no-deps", "--no-index", wheel)
    # A folder that is named in a .pth is not itself searched for .pth files: the editable install here stays out.
    (libraries / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return scripts


def run(installed, folder, *arguments, timeout_s=120):
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    command = [str(installed / arguments[0]), *map(str, arguments[1:])]
    return subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=folder, env=environment, timeout=timeout_s
    )


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


def test_it_says_where_the_studies_are(installed, tmp_path):
    done = run(installed, tmp_path, "dbbstation", "study", "coverage")
    assert done.returncode == 2
    assert done.stderr.endswith("No such command 'study'; it is now `python -m studies` in a checkout\n")


def keep_compiled(package):
    """Give the package what was compiled of the checkout: its loops are the same to the letter, and are known by place, size and date."""
    for made in (CHECKOUT / "dbbstation").rglob("__pycache__/*.nb[ci]"):
        loops = made.parents[1] / f"{made.name.partition('.')[0]}.py"
        if not loops.is_file():
            continue  # compiled of a former state
        installed = package / loops.relative_to(CHECKOUT / "dbbstation")
        assert installed.read_bytes() == loops.read_bytes()
        os.utime(installed, ns=(loops.stat().st_atime_ns, loops.stat().st_mtime_ns))
        installed.with_name("__pycache__").mkdir(exist_ok=True)
        shutil.copy(made, installed.with_name("__pycache__"))


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


def test_it_does_the_whole_job(installed, tmp_path):
    keep_compiled(shipped(installed, tmp_path, "protocols").parent)
    done = run(installed, tmp_path, "dbbstation", "demo", "--quick", "--out", "demo", timeout_s=900)
    assert done.returncode == 0, done.stderr
    assert re.search(r"(?m)^mean +\d", done.stdout)
    assert (tmp_path / "demo" / "report.html").is_file()
