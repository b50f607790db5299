"""`dbbstation instrument emulate` in a process of its own."""

from __future__ import annotations

import json
import signal
import subprocess
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.model import write_model
from dbbstation.instrument.driver import Instrument
from dbbstation.instrument.library import load_instrument
from dbbstation.model.identified import IdentifiedModel
from dbbstation.model.machine_model import MachineModel
from dbbstation.virtual.control import ControlClient
from dbbstation.virtual.truth import random_kinematics
from tests.cli.conftest import call
from tests.copied import started
from tests.station.bench import MACHINE_FILE, POLLED, STREAM

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.usefixtures("copies")


def command(plan_file: Path, *more: str, instrument: str = STREAM) -> list[str]:
    words = ["--instrument", instrument, "--plan", str(plan_file), "--machine", str(MACHINE_FILE)]
    return ["instrument", "emulate", *words, *more]


def emulated(words: list[str]) -> subprocess.Popen[str]:
    return started(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def identified(model: MachineModel) -> IdentifiedModel:
    return IdentifiedModel(model, (("base-joints", "", "joint_1_x_mm"),), np.eye(1))


@pytest.mark.parametrize("ending", ["quit", signal.SIGINT, signal.SIGTERM])
def test_it_answers_on_both_lines_until_it_is_told_to_end(plan_file: Path, ending: str | signal.Signals) -> None:
    with emulated(command(plan_file, "--json", "--time-scale", "20", instrument=POLLED)) as process:
        assert process.stdout is not None
        told = json.loads(process.stdout.readline())
        client = ControlClient(told["control"])
        assert client.ask("start", "a", "ccw")["mounting"] == 1
        with Instrument(load_instrument(POLLED), told["port"]) as instrument:
            lengths = [reading.length_mm for reading in instrument.readings(5)]
        if isinstance(ending, str):
            client.ask(ending)
        else:
            process.send_signal(ending)
        _, said = process.communicate(timeout=20.0)
    assert process.returncode == 0
    assert "Traceback" not in said
    assert lengths == pytest.approx([151.5] * 5, abs=1.6)


def test_the_truth_is_that_of_the_model_file(plan_file: Path, tmp_path: Path) -> None:
    machine = read_machine(MACHINE_FILE)
    truth = MachineModel(machine, random_kinematics(machine, 12))
    file = tmp_path / "truth.yaml"
    write_model(file, identified(truth))
    with emulated(command(plan_file, "--truth", str(file), "--json")) as process:
        assert process.stdout is not None
        client = ControlClient(json.loads(process.stdout.readline())["control"])
        sources = {source["name"]: source["parameters"] for source in client.ask("truth")["sources"]}
        client.ask("quit")
        process.communicate(timeout=20.0)
    assert list(sources["base-joints"].values()) == truth.sources[1].values.tolist()


def test_the_truth_of_another_machine_is_refused(plan_file: Path, tmp_path: Path) -> None:
    machine = read_machine(MACHINE_FILE.with_name("every-key.yaml"))
    file = tmp_path / "truth.yaml"
    write_model(file, identified(MachineModel(machine, random_kinematics(machine, 12))))
    done = call(*command(plan_file, "--truth", str(file)))
    assert done.code == 1
    assert "its nominal machine (every key of a machine) is not the one given" in done.err


def test_without_json_it_prints_what_to_copy(plan_file: Path) -> None:
    with emulated(command(plan_file)) as process:
        assert process.stdout is not None
        lines = [process.stdout.readline() for _ in range(2)]
        process.terminate()
        _, said = process.communicate(timeout=20.0)
    assert "note: sends 250 readings a second; streaming-encoder has 250" in said
    assert [line.partition(": ")[0] for line in lines] == ["port", "control"]
