"""The wheel, in an environment of its own, and the one quick demonstration of a run, which it makes.

The environment is new and takes only other packages from here; `python releasing.py try` installs them anew, too.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
from dataclasses import dataclass
from pathlib import Path

import pytest

import releasing
from tests.once import alone, made_once, of_the_run

CHECKOUT = Path(__file__).parents[1]
BUILDS = importlib.util.find_spec("pip") is not None
"""Whether this environment has a pip to build with."""


def pip(*arguments):
    command = [sys.executable, "-m", "pip", *map(str, arguments), "--quiet", "--disable-pip-version-check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="session")
def wheel(tmp_path_factory):
    def make(folder):
        files = releasing.built(folder)
        assert releasing.faults_of(files) == []

    (built,) = made_once(tmp_path_factory, "wheel", make).glob("dbbstation-*.whl")
    return built


@pytest.fixture(scope="session")
def installed(tmp_path_factory, wheel):
    """Scripts of a new environment that has the wheel, and everything else from this environment."""
    # Scripts name the place of their environment: it is made where it stays.
    folder = of_the_run(tmp_path_factory) / "environment"
    paths = sysconfig.get_paths(vars={"base": str(folder), "platbase": str(folder)})
    scripts, libraries = Path(paths["scripts"]), Path(paths["purelib"])
    # A folder that is named in a .pth is not itself searched for .pth files: the editable install here stays out.
    whole = libraries / "libraries.pth"
    with alone(folder):
        if not whole.exists():
            venv.create(folder, with_pip=False)
            python = scripts / Path(sys.executable).name
            python = python if python.exists() else scripts / "python"
            pip("--python", python, "install", "--no-deps", "--no-index", wheel)
            keep_compiled(libraries / "dbbstation")
            whole.write_text(sysconfig.get_path("purelib") + "\n")
    return scripts


def run(installed, folder, *arguments, timeout_s=120):
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    command = [str(installed / arguments[0]), *map(str, arguments[1:])]
    return subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=folder, env=environment, timeout=timeout_s
    )


def keep_compiled(package):
    """Give the package what was compiled of the checkout: its loops are the same to the letter, and are known by place, size and date."""
    for made in (CHECKOUT / "dbbstation").rglob("__pycache__/*.nb[ci]"):
        loops = made.parents[1] / f"{made.name.partition('.')[0]}.py"
        if not loops.is_file():
            continue  # compiled of a former state
        copy = package / loops.relative_to(CHECKOUT / "dbbstation")
        assert copy.read_bytes() == loops.read_bytes()
        os.utime(copy, ns=(loops.stat().st_atime_ns, loops.stat().st_mtime_ns))
        copy.with_name("__pycache__").mkdir(exist_ok=True)
        shutil.copy(made, copy.with_name("__pycache__"))


@dataclass(frozen=True)
class Demonstration:
    """Folder of a job that is only read, and what its command printed."""

    job: Path
    out: str
    err: str


@pytest.fixture(scope="session")
def quick_demo(request, tmp_path_factory):
    """`demo --quick --json` as the wheel does it; by the checkout where no wheel can be built."""

    def make(folder):
        words = ("demo", "--quick", "--out", "job", "--json")
        if BUILDS:
            done = run(request.getfixturevalue("installed"), folder, "dbbstation", *words, timeout_s=900)
        else:
            command = [sys.executable, "-m", "dbbstation", *words]
            done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder, timeout=900)
        assert done.returncode == 0, done.stderr
        (folder / "printed.json").write_text(done.stdout, encoding="utf-8")
        (folder / "said.txt").write_text(done.stderr, encoding="utf-8")

    folder = made_once(tmp_path_factory, "demonstration", make)
    printed, said = ((folder / name).read_text(encoding="utf-8") for name in ("printed.json", "said.txt"))
    return Demonstration(folder / "job", printed, said)
