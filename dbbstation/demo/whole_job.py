"""Do the whole job on a virtual machine over a serial line, with the user's commands."""

from __future__ import annotations

import json
import re
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.errors import StationError
from dbbstation.facts.serialise import as_objects, read_json
from dbbstation.files.atomic import write_text
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.model import write_model
from dbbstation.files.formats.plan import plan_text, read_inline_plan
from dbbstation.files.places import shipped_folder
from dbbstation.model.identified import IdentifiedModel
from dbbstation.model.machine_model import MachineModel
from dbbstation.results.demo import DemoCircle, DemoResult, MeasuredBeforeAfter
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources
from dbbstation.system.copies import copies
from dbbstation.virtual.truth import random_kinematics

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator
    from contextlib import AbstractContextManager
    from pathlib import Path

    from dbbstation.files.formats.plan import PlanFile
    from dbbstation.system.copies import Starter
    from dbbstation.tasks.telling import Progress

INSTRUMENT = "streaming-encoder"
RATE = ["--rate-hz", "20"]
"""Sampling rate: some 1500 samples per circle."""

COMPLIANCE_UM_KN = 9.68
"""Strut compliance that gives the reference machine the circular deviations of [GRAV Table 4]."""

QUICK = ("a", "h", "n")
"""Tests of a quick demonstration: one at each height, two of them tilted."""

_CIRCLE = re.compile(r"(\d+) of (\d+): (test .*)")
"""Pattern of the line that `measure` prints when a circle begins."""

SETTINGS = """# The shop's settings of this demonstration: what its circles have to keep.
format: dbb-settings/1
tolerances:
  - {quantity: circular-deviation, largest: 8.0, unit: µm}
  - {quantity: centre-deviation, largest: 15.0, unit: µm}
"""
"""Tolerances that the compensated machine meets and the nominal one exceeds; holders reproduce balls to a few
micrometres."""


def run_demo(
    folder: Path,
    seed: int,
    tell: Callable[[str], None],
    progress: Progress,
    tests: Collection[str] | None = None,
) -> DemoResult:
    """Do the whole job and write its files into a folder.

    Args:
        folder: new folder.
        tell: receives each command before it runs.
        progress: receives each circle, and how many are done.
        tests: names; None: all fifteen of [CAL Table II].

    Raises:
        StationError: a step failed; earlier results stay.
    """
    folder.mkdir(parents=True)
    machine_file = shipped_folder("fixtures") / "machines" / "reference.yaml"
    plan_file = shipped_folder("protocols") / "plans" / "table2.yaml"
    if tests is not None:
        plan_file = write_plan(folder / "plan.yaml", read_inline_plan(plan_file), tests)
    with copied_commands() as start:
        write_truth(folder / "truth.yaml", machine_file, seed)
        write_text(folder / "dbbstation-settings.yaml", SETTINGS)
        what = ["--plan", str(plan_file.resolve()), "--machine", str(machine_file)]
        job = DemoJob(folder, what, tell, progress, start)
        # One virtual machine for both measurements: balls and bar stay, every holder is put up anew. It reads programs
        # when they are started, so that their folder may still be empty.
        (folder / "programs").mkdir()
        truth = ["--truth", "truth.yaml", "--seed", str(seed), "--programs", "programs"]
        with job.emulated(truth) as place:
            job.measure(place, "measured", [])
            calibration = job.answer(["calibrate", "measured", "--out", "kinematic.yaml"])
            diagnosis = job.answer(["diagnose", "measured", "--out", "joint.yaml"])
            job.answer(["program", *job.what, "--dialect", "linuxcnc", "--model", "joint.yaml", "--out", "programs"])
            job.measure(place, "verified", ["--programs", "programs"])
        before, after = (
            _read(job.answer(["evaluate", session, "--model", "joint.yaml"])) for session in ("measured", "verified")
        )
        report = job.answer(
            ["report", "verified", "--before", "measured", "--model", "joint.yaml", "--page", "report.html"]
        )
    return DemoResult(
        folder,
        _side_by_side(before, after),
        _read(calibration),
        _read(diagnosis),
        _read(report),
        {"diagnosis": diagnosis, "report": report},
    )


def write_truth(path: Path, machine_file: Path, seed: int) -> None:
    """Write the errors of a virtual machine: geometry drawn by the seed, and gravity."""
    machine = read_machine(machine_file)
    gravity = Fitted(known_sources()["gravity"], np.array([COMPLIANCE_UM_KN]))
    fitted = (*random_kinematics(machine, seed), gravity)
    rows = tuple(row for f in fitted for row in f.rows(machine))
    exact = np.zeros((len(rows), len(rows)))
    write_model(path, IdentifiedModel(MachineModel(machine, fitted), rows, exact))


def write_plan(path: Path, whole: PlanFile, names: Collection[str]) -> Path:
    """Write a plan with these tests only; return its path."""
    tests = tuple(test for test in whole.tests if test.name in names)
    write_text(path, plan_text(whole.model_copy(update={"tests": tests})))
    return path


def copied_commands() -> AbstractContextManager[Starter]:
    """Return what runs the commands: copies of a process that has imported them."""
    return copies("dbbstation", "dbbstation.demo.loaded")


@dataclass(frozen=True)
class _Place:
    """Port of the virtual instrument and control address of the machine."""

    port: str
    control: str


@dataclass(frozen=True)
class DemoJob:
    """Runs commands in the demonstration's folder."""

    folder: Path
    what: list[str]
    tell: Callable[[str], None]
    progress: Progress
    start: Starter

    def answer(self, arguments: list[str]) -> str:
        """Run a command and return its JSON."""
        self.tell("dbbstation " + " ".join(_short(argument) for argument in arguments))
        with self.start([*arguments, "--json"], self.folder, answers=True) as process:
            printed, said = process.communicate()
            if process.wait() != 0:
                raise StationError(said.strip(), where=f"dbbstation {arguments[0]}")
        return printed

    def measure(self, place: _Place, session: str, programs: list[str]) -> None:
        """Measure the virtual machine over its serial line."""
        arguments = ["measure", *self.what, "--instrument", INSTRUMENT, "--out", session, *programs]
        line = ["--port", place.port, "--auto", place.control, *RATE]
        bar = ["--bar-length-mm", "150", "--bar-uncertainty-um", "0.5"]
        self.tell("dbbstation " + " ".join(_short(argument) for argument in [*arguments, *line]))
        with self.start([*arguments, *line, *bar], self.folder, answers=False) as process:
            said = []
            for text in process.stderr or ():
                said.append(text.rstrip())
                if begins := _CIRCLE.fullmatch(text.strip()):
                    self.progress(begins[3], int(begins[1]) - 1, int(begins[2]))
            if process.wait() != 0:
                raise StationError("\n".join(said[-5:]), where="dbbstation measure")

    @contextmanager
    def emulated(self, arguments: list[str]) -> Iterator[_Place]:
        """Run the virtual machine as a process.

        Yields:
            Its port and its control address.

        Raises:
            StationError: it does not start.
        """
        words = ["instrument", "emulate", "--instrument", INSTRUMENT, *self.what, *arguments, *RATE, "--wait", "--json"]
        with self.start(words, self.folder, answers=True) as process:
            first = process.stdout.readline() if process.stdout else ""
            if not first:
                _, said = process.communicate()
                raise StationError(said.strip() or "it ended at once", where="dbbstation instrument emulate")
            yield read_json(_Place, first)
            process.terminate()


def _short(argument: str) -> str:
    return argument.rpartition("/")[2] if argument.endswith(".yaml") else argument


def _read(printed: str) -> Any:  # noqa: ANN401 - of any command
    return as_objects(json.loads(printed))


def _side_by_side(before: Any, after: Any) -> tuple[DemoCircle, ...]:  # noqa: ANN401 - results as objects
    """Return figures of the same runs in two sessions [CAL Table III]."""
    later = {(run.test, run.direction): _measured(run) for run in after.runs}
    return tuple(
        DemoCircle(run.test, _measured(run), later[run.test, run.direction])
        for run in before.runs
        if run.direction == "ccw"
    )


def _measured(run: Any) -> MeasuredBeforeAfter:  # noqa: ANN401 - the same
    return MeasuredBeforeAfter(**vars(run.measured), circularity_30_upr_um=run.circularity_30_upr_um.measured)
