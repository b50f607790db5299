"""Folders that an ordinary user may only read: what reads works, what writes is refused in one sentence before long work."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from numba.core.caching import _CacheLocator

from dbbstation.files.places import shipped_folder

FIXTURES = shipped_folder("fixtures")
CHECKOUT = Path(__file__).parents[2]
NOBODY = 65534
AS_NOBODY = (
    "setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups",
    # Only reading: the interpreter may lie where others may not look.
    *(f"--{which}=-all,+dac_read_search" for which in ("inh-caps", "ambient-caps", "bounding-set")),
)  # fmt: skip


@pytest.fixture
def here(tmp_path):
    """Sessions, a model and a folder of the user's own beside them."""
    if os.name == "nt" or (os.geteuid() == 0 and shutil.which("setpriv") is None):
        pytest.skip("no ordinary user to run as")
    folder = tmp_path / "shared"
    for name in ("small", "logged"):
        shutil.copytree(FIXTURES / "sessions" / name, folder / name)
    shutil.copy(FIXTURES / "models" / "small.yaml", folder / "model.yaml")
    (folder / "mine").mkdir()
    give_compiled(folder / "mine")
    for path in [folder, *folder.rglob("*")]:
        path.chmod(0o555 if path.is_dir() else 0o444)
    for path in [folder / "mine", *(folder / "mine").iterdir()]:
        path.chmod(0o777)
    for parent in (tmp_path, *tmp_path.parents):
        if parent.owner() != "root" or parent.stat().st_mode & 0o005 == 0:
            parent.chmod(parent.stat().st_mode | 0o005)
        if parent.name.startswith("pytest-of"):
            break
    yield folder
    for path in [folder, *folder.rglob("*")]:
        if path.is_dir():
            path.chmod(0o755)


def give_compiled(cache):
    """Copy what the checkout has compiled to where Numba looks for it: to compile it takes ten seconds."""
    for made in (CHECKOUT / "dbbstation").rglob("__pycache__/*.nb[ci]"):
        place = cache / _CacheLocator.get_suitable_cache_subpath(str(made.parents[1] / "loops.py"))
        place.mkdir(exist_ok=True)
        shutil.copy(made, place)


def run(folder, line):
    words = [sys.executable, "-P", "-m", "dbbstation", *line.split()]
    environment = os.environ | {"HOME": "/nonexistent", "PYTHONPATH": str(CHECKOUT)}
    environment |= {"NUMBA_CACHE_DIR": str(folder / "mine")}
    command = [*AS_NOBODY, *words] if os.geteuid() == 0 else words
    began_s = time.monotonic()
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False, timeout=120
    )
    return done, time.monotonic() - began_s


@pytest.mark.parametrize(
    "line",
    [
        "check small logged",
        "session list small",
        "export small --out mine/e.csv",
        pytest.param("history . --json", marks=pytest.mark.nightly),  # the next line reads as much
        "history . --table mine/h.csv",
    ],
)
def test_what_only_reads_works(here, line):
    done, _ = run(here, line)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "line",
    [
        "export small --out e.csv",
        "calibrate small --out m.yaml",
        "report small --page r.html",
        "history . --table h.csv",
        "session reject small a-ccw-1 --reason spoilt",
        "session amend logged --reason changed",
        "fleet . --task circles --out f",
    ],
)
def test_what_writes_there_is_refused_in_one_sentence(here, line):
    before = there(here)
    done, _ = run(here, line)
    assert done.returncode == 1
    (said,) = [text for text in done.stderr.splitlines() if not text.startswith("note: ")]
    assert re.search("cannot be (written|made): [Pp]ermission denied", said)
    assert there(here) == before


def there(folder):
    return sorted(path.relative_to(folder) for path in folder.rglob("*") if "mine" not in path.parts)
