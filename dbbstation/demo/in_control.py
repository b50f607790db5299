"""Correct one machine that LinuxCNC drives in four ways, as `dbbstation demo --control linuxcnc` does."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.control.parameters import Values, hal_lines, home_mm, tables
from dbbstation.demo.whole_job import DemoJob, copied_commands, write_plan, write_truth
from dbbstation.errors import StationError
from dbbstation.facts.serialise import as_objects
from dbbstation.files.atomic import write_text
from dbbstation.files.formats.machine import machine_text, read_machine
from dbbstation.files.formats.model import write_model
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.places import shipped_folder
from dbbstation.files.source_text import text_of
from dbbstation.machine.geometry import STRUTS, Hexapod, Rotation
from dbbstation.machine.kinematics import strut_lengths
from dbbstation.machine.travel import middle
from dbbstation.model.identified import IdentifiedModel
from dbbstation.model.machine_model import MachineModel
from dbbstation.results.demo import ControlWay
from dbbstation.virtual.linuxcnc import ControlKins, driven_program, installed_component, missing, run

if TYPE_CHECKING:
    from collections.abc import Callable, Collection
    from pathlib import Path

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.tasks.telling import Progress

COMPONENT = "dbbdemokins"
"""Name of the temporary component, unlike any component of a shop."""

DIAGNOSED = "joint.yaml"

OTHER_HOLDERS = 1
"""Added to the seed for the diagnosed session: its holders, balls and bar differ from those of the four corrections,
which share theirs."""

VOLUME = "--volume=-200,200,-200,200,-1150,-870"
"""Volume for refitted parameters: most of the volume of the circles of [CAL Table II]; its corners are in the
travel."""

FASTER = 4
"""Speed of LinuxCNC's clock relative to real time; two slow cores are fast enough."""

_SECONDS = re.compile(r"LinuxCNC took ([\d.]+) s")


def refuse_without_linuxcnc() -> None:
    """Refuse a computer that cannot run LinuxCNC with a kinematics.

    Raises:
        StationError: says what is missing.
    """
    if lacking := missing(kinematics=True):
        remedy = "call the command with sudo" if "root" in lacking else "install the Debian package linuxcnc-uspace-dev"
        raise StationError(lacking, where="demo --control linuxcnc", remedy=remedy)


def run_ways(
    folder: Path,
    seed: int,
    tell: Callable[[str], None],
    progress: Progress,
    tests: Collection[str] | None = None,
    *,
    model: str = DIAGNOSED,
) -> tuple[ControlWay, ...]:
    """Measure one machine under LinuxCNC, nominal and corrected in three ways, and a faultless machine for comparison.

    Args:
        folder: new folder, or folder of an interrupted job.
        tell: receives each command before it runs.
        progress: receives each circle, and how many are done.
        tests: names; None: all fifteen of [CAL Table II].
        model: correcting model file in the folder: diagnosed from a separate session, or `truth.yaml`.

    Raises:
        StationError: a step failed; earlier results stay.
    """
    refuse_without_linuxcnc()
    folder.mkdir(parents=True, exist_ok=True)
    machine = _write_files(folder, seed, tests)
    with copied_commands() as start:
        job = DemoJob(folder, ["--plan", "plan.yaml", "--machine", "machine.yaml"], tell, progress, start)
        return _ways(job, machine, seed, model)


def _ways(job: DemoJob, machine: Machine, seed: int, model: str) -> tuple[ControlWay, ...]:
    folder = job.folder
    program = ["program", *job.what, "--dialect", "linuxcnc", "--bar-stays-on", "--force"]
    job.answer([*program, "--out", "programs"])
    plain = genhexkins(machine, None)
    nominal = _driven(job, machine, "nominal", plain, "programs")
    if model == DIAGNOSED and not (folder / model).exists():
        _session(job, "measured", nominal, seed + OTHER_HOLDERS)
        job.answer(["diagnose", "measured", "--out", model])
    by = ["--model", model]
    ways = [_way(job, "faultless", nominal, seed, truth="faultless.yaml"), _way(job, "nominal", nominal, seed)]

    job.answer([*program, *by, "--out", "compensated"])
    ways.append(
        _way(job, "program", _driven(job, machine, "program", plain, "compensated"), seed, programs="compensated")
    )

    answer = job.answer(["control", "parameters", *by, VOLUME, "--out", "genhexkins", "--force"])
    given = replace(
        plain,
        offset_mm=plain.offset_mm + np.array(json.loads(answer)["home_mm"]),
        hal=tuple(text_of(folder / "genhexkins" / "genhexkins.hal").splitlines()),
        tables=tuple(text_of(path) for path in sorted((folder / "genhexkins").glob("joint-*.comp"))),
    )
    driven = _driven(job, machine, "parameters", given, "programs")
    ways.append(_way(job, "parameters", driven, seed, machine="genhexkins/machine.yaml"))

    component = folder / f"{COMPONENT}.comp"
    job.answer(["control", "kinematics", *by, "--out", component.name, "--force"])
    with installed_component(component):
        driven = _driven(job, machine, "kinematics", made_kins(machine, COMPONENT), "programs")
    ways.append(_way(job, "kinematics", driven, seed, machine=f"{COMPONENT}.machine.yaml"))
    return tuple(ways)


def _write_files(folder: Path, seed: int, tests: Collection[str] | None) -> Machine:
    """Write plan, machine and truths; the machine turns as genhexkins does, so that one program suits all ways."""
    of = read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")
    machine = replace(of, hexapod=Hexapod(of.hexapod.base_joints_mm, of.hexapod.platform_joints_mm, Rotation.ZYX))
    if not (folder / "truth.yaml").exists():
        whole = read_inline_plan(shipped_folder("protocols") / "plans" / "table2.yaml")
        write_text(folder / "machine.yaml", machine_text(machine), force=True)
        write_plan(folder / "plan.yaml", whole, tests or [test.name for test in whole.tests])
        write_model(folder / "faultless.yaml", IdentifiedModel(MachineModel(machine), (), np.zeros((0, 0))))
        write_truth(folder / "truth.yaml", folder / "machine.yaml", seed)
    return machine


def _driven(job: DemoJob, machine: Machine, way: str, kins: ControlKins, programs: str) -> Path:
    driven = job.folder / "driven" / way
    driven.mkdir(parents=True, exist_ok=True)
    given = sorted((job.folder / programs).glob("*.ngc"))
    for done, program in enumerate(given):
        if not (driven / program.name).exists():
            job.progress(f"LinuxCNC, {way}", done, len(given))
            ran = run(text_of(program), faster=FASTER, kins=kins)
            text = driven_program(machine, ran)
            write_text(driven / program.name, f"{text}(LinuxCNC took {ran.duration_s:.3f} s)\n")
    return driven


def _session(
    job: DemoJob,
    name: str,
    driven: Path,
    seed: int,
    *,
    truth: str = "truth.yaml",
    machine: str = "machine.yaml",
    programs: str = "programs",
) -> None:
    """Measure a machine on the paths that LinuxCNC drives; remove an interrupted measurement first."""
    shutil.rmtree(job.folder / name, ignore_errors=True)
    of_this = replace(job, what=["--plan", "plan.yaml", "--machine", machine])
    with job.emulated(["--truth", truth, "--seed", str(seed), "--programs", f"driven/{driven.name}"]) as place:
        of_this.measure(place, name, ["--programs", programs])


def _way(job: DemoJob, name: str, driven: Path, seed: int, **more: str) -> ControlWay:
    kept = job.folder / f"{name}.json"
    if not kept.exists():
        _session(job, name, driven, seed, **more)
        write_text(kept, job.answer(["evaluate", name, "--model", "truth.yaml"]))
    took = sum(float(said) for path in sorted(driven.glob("*.ngc")) for said in _SECONDS.findall(text_of(path)))
    return ControlWay(name, tuple(as_objects(json.loads(text_of(kept))).runs), took)


def home_mm_of(machine: Machine) -> Floats:
    """Return the driven lengths at the middle of the travel, where the machine is switched on, shape (6,)."""
    return (strut_lengths(machine.hexapod, middle(machine)) - machine.reference_length_error_mm)[0]


def _middle_mm(machine: Machine) -> float:
    return float(middle(machine).position_mm[0, 2])


def made_kins(machine: Machine, name: str, *hal: str) -> ControlKins:
    """Return LinuxCNC's set-up for a generated component."""
    enabled = f"net on motion.motion-enabled => {name}.enabled"
    return ControlKins(name, home_mm_of(machine), np.zeros(STRUTS), _middle_mm(machine), (enabled, *hal))


def genhexkins(machine: Machine, values: Values | None) -> ControlKins:
    """Return LinuxCNC's set-up for its own kinematics, with nominal joints or refitted values."""
    none, longer = np.zeros((STRUTS, 3)), machine.reference_length_error_mm
    of = values or Values(none, none, longer, np.array(machine.travel.strut_mm), np.zeros((STRUTS, 2)))
    corrected = longer + home_mm(of, machine)
    given = hal_lines(of, machine), tables(of, np.zeros(STRUTS))
    return ControlKins("genhexkins", home_mm_of(machine), corrected, _middle_mm(machine), *given)
