"""Correct a machine inside its control: by a LinuxCNC kinematics from a model, or by parameters for LinuxCNC's own."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.control.commands import correction_of
from dbbstation.control.kinematics import HELD_BY_BACKLASH, component, settings
from dbbstation.control.parameters import FITTED, TRIED, SourceLeft, drawn_poses, hal_lines, home_mm, refitted, tables
from dbbstation.errors import ModelError, StationError
from dbbstation.facts import of_facts
from dbbstation.files.atomic import refuse_outputs, write_folder, write_text
from dbbstation.files.formats.machine import machine_text, read_machine
from dbbstation.files.formats.model import read_model
from dbbstation.files.inputs import in_a_book
from dbbstation.files.places import package_text
from dbbstation.machine.geometry import STRUTS, Rotation, differences, in_words
from dbbstation.machine.travel import check_travel
from dbbstation.results.control import KinematicsResult, ParametersResult
from dbbstation.results.model_warnings import model_warnings
from dbbstation.tasks.programs import program_text, sha256_of

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence
    from pathlib import Path

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.model.machine_model import MachineModel
    from dbbstation.sources.contract import ErrorSource

SUFFIX = ".comp"

TILT_DEG = 15.0
SIZE_MM = 200.0
"""Default volume: the size of parts on a machine of this kind."""

MACHINE_SUFFIX = ".machine.yaml"
"""Ending of the machine file that states the control's corrections."""


@in_a_book
def kinematics(
    model: Path,
    out: Path,
    *,
    date: str,
    known: Mapping[str, ErrorSource],
    machine: Path | None = None,
    left_out: Collection[str] = (),
    thermometers: Collection[str] = (),
    force: bool = False,
) -> KinematicsResult:
    """Write a LinuxCNC kinematics component that corrects a model's errors.

    Args:
        out: a `.comp` file; its stem is the component's name. The machine file beside it states the control's
            corrections.
        date: of today, ISO 8601.
        known: error sources by name.
        machine: file of the machine that it is for; None: not compared.
        left_out: sources to leave uncorrected.
        thermometers: the control's thermometers, as column names without unit.

    Raises:
        InputError: faults of files.
        ModelError: the model is of another machine or lacks uncertainty, or a kinematics cannot hold a source.
        OutputError: `out` exists without `force`.
        StationError: the component's name is no C name.
    """
    if out.suffix != SUFFIX:
        raise StationError(f"{out.name} cannot be the name of a component file", remedy=f"end it with {SUFFIX}")
    corrected = out.with_suffix(MACHINE_SUFFIX)
    refuse_outputs([out, corrected], force=force)
    identified, digest = _read(model, known, machine), sha256_of(model)
    made = component(
        identified.model,
        package_text,
        out.stem,
        digest,
        left_out=left_out,
        thermometers=thermometers,
    )
    ini, hal = settings(made, identified.model)
    taken_out = [f for f in identified.model.of_the_machine().sources if f.source.name in made.parts]
    control = correction_of("kinematics", digest, date, taken_out, identified.model.machine)
    write_text(corrected, machine_text(replace(identified.model.machine, control=control)), force=force)
    write_text(out, made.text, force=force)
    return of_facts(
        KinematicsResult,
        made,
        file=str(out),
        model_sha256=digest,
        install=(f"sudo halcompile --install {out.name}",),
        ini=ini,
        hal=hal,
        machine_file=str(corrected),
        way_back=(
            "put the former KINEMATICS line back into the INI file, the former lines into the HAL file, and home again",
            "use the former machine file again, without `control`",
        ),
        notes=(*model_warnings(identified), HOMING, UNITS),
    )


HOMING = (
    "home all joints again after the change: HOME and HOME_OFFSET stay, because joints are still the driven strut lengths; "
    "X, Y, Z, A, B, C of a standing machine change by its errors"
)
UNITS = "the component counts in mm and degrees: LINEAR_UNITS = mm, ANGULAR_UNITS = degree"


@in_a_book
def parameters(
    model: Path,
    out: Path,
    *,
    date: str,
    known: Mapping[str, ErrorSource],
    machine: Path | None = None,
    volume_mm: Sequence[float] | None = None,
    tilt_deg: float = TILT_DEG,
    ini: Path | None = None,
    force: bool = False,
) -> ParametersResult:
    """Write values for LinuxCNC's genhexkins and tables of its joints, refitted to a model over a volume.

    Args:
        out: folder.
        date: of today, ISO 8601.
        known: error sources by name.
        machine: file of the machine that it is for; None: not compared.
        volume_mm: least and greatest X, Y and Z; None: 200 mm about the middle of the travel.
        tilt_deg: greatest A and B.
        ini: INI file in use, which is searched for corrections of joints.

    Raises:
        InputError: faults of files.
        ModelError: the model is of another machine, or without uncertainty.
        OutputError: a file exists without `force`.
        TravelError: the volume leaves the travel.
    """
    identified, digest = _read(model, known, machine), sha256_of(model)
    own, nominal = identified.model, identified.model.machine
    low, high = _volume(nominal, volume_mm, tilt_deg)
    poses, others = (drawn_poses(low, high, count, seed) for seed, count in ((1, FITTED), (2, TRIED)))
    corners = np.array(list(product(*zip(low, high, strict=True))))
    for given in (corners, poses, others):
        check_travel(nominal, given, where="the volume")
    found = refitted(own, poses, others)
    play = next((f.values for f in own.sources if f.source.name == HELD_BY_BACKLASH and len(f.values) == STRUTS), None)
    lines = tables(found.values, np.zeros(STRUTS) if play is None else 1e-3 * play)
    in_table = {one.name for one in found.sources if one.held_by == "table"}
    taken_out = (*found.values.sources(), *(f for f in own.of_the_machine().sources if f.source.name in in_table))
    corrected = replace(nominal, control=correction_of("parameters", digest, date, taken_out, nominal))
    joints = hal_lines(found.values, nominal)
    files = {"genhexkins.hal": "\n".join(joints) + "\n", "parameters.csv": _table(joints)}
    files |= {"machine.yaml": machine_text(corrected)}
    files |= {f"joint-{i}.comp": text for i, text in enumerate(lines)}
    write_folder(out, files, force=force)
    home = home_mm(found.values, nominal).tolist()
    settings_of = ["[KINS]", "KINEMATICS = genhexkins", f"JOINTS = {STRUTS}"]
    for i in range(STRUTS):
        settings_of += [f"[JOINT_{i}]", f"HOME and HOME_OFFSET: add {home[i]:.6f}"]
        settings_of += [f"COMP_FILE = joint-{i}.comp", "COMP_FILE_TYPE = 1"] if lines else []
    return ParametersResult(
        folder=str(out),
        files=tuple(files),
        model_sha256=digest,
        low=tuple(low.tolist()),
        high=tuple(high.tolist()),
        left=found.left,
        sources=_held(own, found.sources, with_play=play is not None),
        home_mm=tuple(home),
        ini=tuple(settings_of),
        way_back=(
            "put the former lines back into INI and HAL files, and home again",
            "use the former machine file again",
        ),
        notes=(*model_warnings(identified), *_rotation_note(nominal), *([] if ini is None else _active(ini))),
    )


_HELD_IN_INI = re.compile(r"(COMP_FILE|BACKLASH)\s*=\s*(?P<value>[^#;\s]+)")


def _volume(machine: Machine, volume_mm: Sequence[float] | None, tilt_deg: float) -> tuple[Floats, Floats]:
    middle_mm, half = np.array([0.0, 0.0, sum(machine.travel.z_mm) / 2.0]), SIZE_MM / 2.0
    pairs = np.column_stack([middle_mm - half, middle_mm + half])
    if volume_mm is not None:
        pairs = np.asarray(volume_mm, dtype=np.float64).reshape(3, 2)
        if not (pairs[:, 0] < pairs[:, 1]).all():
            raise StationError("the volume has no size", remedy="give XMIN,XMAX,YMIN,YMAX,ZMIN,ZMAX, each pair rising")
    tilt = np.array([tilt_deg, tilt_deg, 0.0])
    return np.concatenate([pairs[:, 0], -tilt]), np.concatenate([pairs[:, 1], tilt])


def _table(joints: Sequence[str]) -> str:
    rows = [line.removeprefix("setp genhexkins.").rsplit(" ", 1) for line in joints]
    return "joint,value_mm\n" + "".join(f"{name},{value}\n" for name, value in rows)


def _held(model: MachineModel, found: Sequence[SourceLeft], *, with_play: bool) -> tuple[SourceLeft, ...]:
    by_name = {one.name: one for one in found}
    names = [fitted.source.name for fitted in model.of_the_machine().sources]
    others = {name: "table" if with_play and name == HELD_BY_BACKLASH else "nothing" for name in names}
    return tuple(by_name.get(name) or SourceLeft(name, None, None, others[name]) for name in names)


def _rotation_note(machine: Machine) -> list[str]:
    if machine.hexapod.rotation is Rotation.ZYX:
        return []
    own = machine.hexapod.rotation.value
    agree = "both agree as long as only one of A, B and C is not zero"
    return [f"genhexkins turns by {Rotation.ZYX.value}, this machine by {own}: post programs for the former; {agree}"]


def _active(ini: Path) -> list[str]:
    section, found = "", []
    for line in program_text(ini).splitlines():
        section = line.strip() if line.strip().startswith("[") else section
        match = _HELD_IN_INI.match(line.strip())
        if match and section.startswith("[JOINT_") and match["value"].strip("0.") != "":
            found.append(f"{ini.name}: {section} has {match[0]}; the tables written here replace it, do not keep both")
    return found


def _read(path: Path, known: Mapping[str, ErrorSource], machine: Path | None) -> IdentifiedModel:
    identified = read_model(path, known)
    if not identified.covariance_rows:
        raise ModelError(
            "the model does not state the uncertainty of its values",
            where=str(path),
            remedy="give a model of `calibrate` or `diagnose`",
        )
    unlike = () if machine is None else differences(identified.model.machine, read_machine(machine))
    if unlike:
        raise ModelError(
            f"the model is of another machine: {in_words(unlike)}, in the model and in {machine}",
            where=str(path),
            remedy="give the model of this machine",
        )
    return identified
