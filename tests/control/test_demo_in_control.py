"""`demo --control linuxcnc`: one sentence where LinuxCNC is not; four ways where it is, measured by the bar."""

from __future__ import annotations

import shutil

import pytest

from dbbstation.demo.in_control import run_ways
from dbbstation.virtual.linuxcnc import missing
from tests.cli.conftest import call
from tests.nc.planner.required import needs


@pytest.mark.parametrize(
    ("lacking", "root", "said"),
    [
        (
            ("linuxcnc", "halcompile"),
            True,
            "LinuxCNC is not installed here: no linuxcnc, halcompile; install the Debian package",
        ),
        (
            ("halcompile",),
            True,
            "LinuxCNC is not installed here: no halcompile; install the Debian package linuxcnc-uspace-dev",
        ),
        ((), False, "only root installs a kinematics of LinuxCNC; call the command with sudo"),
    ],
)
def test_without_linuxcnc_it_says_so_and_writes_nothing(lacking, root, said, tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None if name in lacking else f"/usr/bin/{name}")
    monkeypatch.setattr("dbbstation.virtual.linuxcnc.is_root", lambda: root)
    outcome = call("demo", "--control", "linuxcnc", "--out", tmp_path / "ways")
    assert outcome.code == 1
    assert outcome.err.startswith(f"demo --control linuxcnc: {said}")
    assert not (tmp_path / "ways").exists()


@needs(missing(kinematics=True))
@pytest.mark.nightly  # ten minutes; `tests.control.through_the_bar` stores its figures
@pytest.mark.xdist_group("linuxcnc")
def test_the_bar_sees_a_faultless_machine_under_the_kinematics(tmp_path):
    ways = {way.way: way for way in run_ways(tmp_path, 3, print, lambda *_: None, ("h",), model="truth.yaml")}
    assert list(ways) == ["faultless", "nominal", "program", "parameters", "kinematics"]
    for run, least in zip(ways["kinematics"].runs, ways["faultless"].runs, strict=True):
        assert run.measured.centre_deviation_um < least.measured.centre_deviation_um + 1.0
        assert run.circularity_30_upr_um.measured < least.circularity_30_upr_um.measured + 1.0
    assert ways["nominal"].runs[0].measured.centre_deviation_um > 100.0
    assert ways["kinematics"].seconds == pytest.approx(ways["nominal"].seconds, rel=0.005)
