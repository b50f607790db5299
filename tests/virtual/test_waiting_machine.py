"""A virtual machine that waits records the same samples on an idle computer and on a busy one."""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import ExitStack, contextmanager

import numpy as np
import pytest

from dbbstation.cli.measure import VirtualHands
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.session import read_session
from dbbstation.instrument.stamps import MachineTime
from dbbstation.virtual.wire_clock import WaitingClock
from tests.cli.conftest import call
from tests.copied import started

pytestmark = pytest.mark.usefixtures("copies")

pytest.importorskip("pty", reason="needs a pseudo-terminal")

MACHINE = shipped_folder("fixtures") / "machines" / "reference.yaml"
PLAN = shipped_folder("protocols") / "plans" / "ten-minute-check.yaml"
WHAT = ["--machine", MACHINE, "--rate-hz", "10", "--instrument"]
BAR = ["--bar-length-mm", "150", "--bar-uncertainty-um", "0.5"]
TURN_S = 400.0 / 360.0 * 2.0 * np.pi * 150.0 / (1000.0 / 60.0)
"""From feed-in to feed-out at the feed of the plan [s]."""
HOG = """
import time
while True:
    until = time.monotonic() + 0.05
    while time.monotonic() < until:
        pass
    time.sleep(0.05)
"""


@contextmanager
def busy(processes):
    with ExitStack() as stack:
        for _ in range(processes):
            hog = stack.enter_context(subprocess.Popen([sys.executable, "-c", HOG]))
            stack.callback(hog.kill)
        yield


def measured(plan, folder, instrument):
    command = ["instrument", "emulate", "--plan", plan, *WHAT, instrument, "--seed", "4", "--wait", "--json"]
    with started(command, stdout=subprocess.PIPE, text=True) as machine:
        try:
            place = json.loads(machine.stdout.readline())
            for name in ("first", "second"):
                line = ["--port", place["port"], "--auto", place["control"], *BAR]
                outcome = call("measure", "--plan", plan, *WHAT, instrument, *line, "--out", folder / name)
                assert outcome.code == 0, outcome.err
            assert VirtualHands(place["control"]).stands_since_s() > 2 * TURN_S
        finally:
            machine.terminate()
    return {f"{path.parent.parent.name}/{path.name}": path.read_bytes() for path in folder.glob("*/runs/*.csv")}


@pytest.mark.slow
@pytest.mark.parametrize("instrument", ["streaming-encoder", "heidenhain-nd287"])
def test_runs_are_the_same_to_the_byte_beside_a_busy_computer(tmp_path, instrument):
    text = PLAN.read_text(encoding="utf-8")
    plan = tmp_path / "plan.yaml"
    left_out = ("name: side", "name: high")
    kept = "".join(line for line in text.splitlines(keepends=True) if not any(name in line for name in left_out))
    plan.write_text(kept.replace("[ccw, cw]", "[ccw]"), encoding="utf-8")
    quiet = measured(plan, tmp_path / "quiet", instrument)
    with busy(2):
        loaded = measured(plan, tmp_path / "loaded", instrument)
    assert len(quiet) == 2
    assert loaded == quiet
    assert quiet["first/low-ccw-1.csv"] != quiet["second/low-ccw-1.csv"]  # the machine's noise goes on
    # Samples lie a period apart, none is lost, and the turn takes as long as the plan's feed says.
    session = read_session(tmp_path / "loaded" / "first")
    assert "machine time" in session.runs[0].instrument.port
    rows = np.loadtxt(
        tmp_path / "loaded" / "first" / "runs" / "low-ccw-1.csv", delimiter=",", skiprows=4, usecols=(0, 1)
    )
    np.testing.assert_allclose(np.diff(rows[:, 0]), 0.1, atol=1.1e-6)
    circle = read_plan(plan).tests["low"].circle
    inside_s = 0.1 * np.count_nonzero(rows[:, 1] < circle.bar_mm + circle.feed_in_mm / 2.0)
    assert circle.swept_deg / circle.turning_deg_s < inside_s < circle.swept_deg / circle.turning_deg_s + 2.0


def test_time_passes_in_runs_only():
    clock = WaitingClock()
    for _ in range(5):
        clock.advance(asked=False)
    assert clock() == 0.0
    clock.settle()  # nothing to wait for
    clock.run_until(10.0)
    passed = [clock() for _ in range(100) if clock.advance(asked=False) is None]
    assert passed == sorted(passed)
    assert 10.0 < passed[-1] == passed[-10] < 20.0
    clock.settle()


def test_samples_are_counted_and_not_timed():
    clock = MachineTime(0.05, 7.0)
    assert clock() == 7.0
    assert [clock.stamp(seen_s) for seen_s in (3.0, 99.0, 99.0)] == pytest.approx([7.0, 7.05, 7.1])
    assert clock.stamp(0.0, lost=2) == pytest.approx(7.25) == clock()
