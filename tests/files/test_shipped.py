"""What the package ships is found from a checkout and from a wheel, and recordings stay out of it."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from dbbstation.errors import InputError
from dbbstation.files.places import shipped_folder

CHECKOUT = Path(__file__).parents[2]


def test_from_a_checkout() -> None:
    assert shipped_folder("protocols") == CHECKOUT / "protocols"
    assert shipped_folder("fixtures") == CHECKOUT / "fixtures"
    with pytest.raises(InputError, match="this folder is missing in the installation; install dbbstation again"):
        shipped_folder("nothing")


def test_from_a_wheel(tmp_path: Path) -> None:
    pytest.importorskip("hatchling", reason="the build tool is not installed here")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(build, cwd=CHECKOUT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    installed = tmp_path / "installed"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(installed)
        names = archive.namelist()
        size = sum(entry.file_size for entry in archive.infolist() if "/fixtures/" in entry.filename)
    assert {name.split("/")[0] for name in names} == {"dbbstation", wheel.name.rsplit("-", 3)[0] + ".dist-info"}
    assert not [name for name in names if name.endswith((".nbi", ".nbc"))]
    # One session comes along to try commands on.
    assert {name.split("/sessions/")[1].split("/")[0] for name in names if "/sessions/" in name} == {"small"}
    assert size < 500_000
    program = (
        "from dbbstation.files.places import shipped_folder\nfrom dbbstation.files.formats.plan import read_plan\n"
        "print(shipped_folder('protocols'))\nprint(len(read_plan(shipped_folder('protocols') / 'plans/table2.yaml').tests))\n"
        "print(len(read_plan(shipped_folder('fixtures') / 'plans/every-key.yaml').tests))\n"
    )
    environment = {"PYTHONPATH": str(installed), "PATH": "/usr/bin:/bin"}
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=environment, check=True, capture_output=True, text=True
    )
    assert done.stdout.split() == [str(installed / "dbbstation" / "protocols"), "15", "4"]
