"""The correction inside a control: a LinuxCNC kinematics of a model, or parameters for its own."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dbbstation.control.commands import correction_of
from dbbstation.control.kinematics import component, settings
from dbbstation.errors import ModelError, StationError
from dbbstation.files.atomic import refuse_outputs, write_text
from dbbstation.files.formats.machine import machine_text, read_machine
from dbbstation.files.formats.model import read_model
from dbbstation.files.inputs import in_a_book
from dbbstation.files.shipped import package_text
from dbbstation.machine.difference import differences, in_words
from dbbstation.results.control import KinematicsResult
from dbbstation.results.model_warnings import model_warnings
from dbbstation.tasks.programs import sha256_of

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping
    from pathlib import Path

    from dbbstation.machine.geometry import ControlCorrection
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.sources.contract import ErrorSource

SUFFIX = ".comp"

MACHINE_SUFFIX = ".machine.yaml"
"""End of the machine file that says what the control corrects."""


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
        out: a `.comp` file; its stem is the component's name. The machine file beside it says what the control corrects.
        date: of today, ISO 8601.
        known: error sources by name.
        machine: file of the machine that it is for; None: not compared.
        left_out: sources that the control shall not correct.
        thermometers: columns without unit that the control has.

    Raises:
        InputError: faults of files.
        ModelError: the model is of another machine, without uncertainty, or a source cannot be held by a kinematics.
        OutputError: `out` exists without `force`.
        StationError: a name that is not C.
    """
    if out.suffix != SUFFIX:
        raise StationError(f"{out.name} is no name of a component file", remedy=f"end it with {SUFFIX}")
    corrected = out.with_suffix(MACHINE_SUFFIX)
    refuse_outputs([out, corrected], force=force)
    identified, digest = _read(model, known, machine), sha256_of(model)
    made = component(
        identified.model,
        package_text("control/kernel.c"),
        out.stem,
        digest,
        left_out=left_out,
        thermometers=thermometers,
    )
    ini, hal = settings(made, identified.model)
    taken_out = [f for f in identified.model.of_the_machine().sources if f.source.name in made.parts]
    _write_machine(
        corrected,
        identified,
        correction_of("kinematics", digest, date, taken_out, identified.model.machine),
        force=force,
    )
    write_text(out, made.text, force=force)
    return KinematicsResult(
        file=str(out),
        name=made.name,
        model_sha256=digest,
        parts=made.parts,
        left_out=made.left_out,
        thermometers=made.thermometers,
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


def _write_machine(path: Path, identified: IdentifiedModel, control: ControlCorrection, *, force: bool) -> None:
    write_text(path, machine_text(replace(identified.model.machine, control=control)), force=force)


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
