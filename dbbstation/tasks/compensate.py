"""Compensate any NC program with a calibrated model."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.control.commands import refuse_second_correction
from dbbstation.files.atomic import refuse_existing, write_text
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.inputs import in_a_book
from dbbstation.files.own_dialects import dialect_given
from dbbstation.machine.difference import check_model_is_of
from dbbstation.nc.compensate import CHORD_MM
from dbbstation.nc.export import compensated_program
from dbbstation.nc.limits import LARGEST_CORRECTION_MM
from dbbstation.nc.registry import dialect_of_file
from dbbstation.results.model_warnings import model_warnings
from dbbstation.results.programs import ProgramsResult, programs_result
from dbbstation.tasks.programs import inverse_of, origin_of, program_text, sha256_of
from dbbstation.tasks.provenance import from_python
from dbbstation.tasks.telling import Telling, silent

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import ArrayLike

    from dbbstation.files.provenance import Provenance
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.models import Model


UNITS_NOT_SAID = (
    "the program says neither G20 nor G21: its lengths are taken for millimetres; a control that still has inches from the program before "
    "would run it 25.4 times as large"
)


@in_a_book
def compensate(
    program: str | PathLike[str],
    model: Model,
    out: str | PathLike[str] | None = None,
    *,
    dialect: str = "linuxcnc",
    written_in: str | None = None,
    start: ArrayLike | None = None,
    chord_um: float = 1e3 * CHORD_MM,
    prefer: str = "accuracy",
    strict: bool = False,
    time_s: float | None = None,
    largest_correction_mm: float = LARGEST_CORRECTION_MM,
    machine: str | PathLike[str] | None = None,
    force: bool = False,
    known: Mapping[str, ErrorSource] | None = None,
    provenance: Callable[[], Provenance] = from_python,
    say: Callable[[str], None] = silent,
) -> ProgramsResult:
    """Compensate an NC program, so that the real machine follows `program`.

    Args:
        program: file in machine coordinates, whole, not compensated, of no other machine.
        model: a model, its file, or the result of `calibrate` or `diagnose`.
        out: file; None: only the text in the result.
        dialect: to write: a name, or a Python file.
        written_in: dialect of `program`; None: by its extension.
        start: pose before the program, X, Y, Z [mm], A, B, C [deg]; None: its first move names all six.
        chord_um: greatest distance of a move from the path.
        prefer: `accuracy`, or `position-only` to leave A, B and C as they are.
        strict: refuse a program that misses the chord error or a feed.
        time_s: start of the program after the session's, for models that depend on time.
        largest_correction_mm: models that shift a point by more are refused.
        machine: file of the machine as it is now, whose control may correct already; None: as the model has it.
        force: overwrite `out`.
        known: error sources by name, for a model file.
        provenance: called for the header after all reading.
        say: called with notes.

    Raises:
        InputError: faults of files.
        OutputError: `out` exists without `force`.
        TravelError: the compensated path leaves the travel.
        KinematicsError: a pose that the machine cannot take.
        ModelError: the model has a source that needs what a program lacks.
        MachineError: a feed that the machine does not reach.
        StationError: the control corrects already; the program is compensated or for another machine, corrections are too large, or `strict` refuses it.
        ValueError: an unknown `prefer`, or `start` is no pose.
    """
    source = Path(program)
    pose = None if start is None else np.asarray(start, dtype=np.float64).reshape(6)
    if out is not None:
        refuse_existing(Path(out), force=force)
    writer = dialect_given(dialect)
    text = program_text(source)
    reader = dialect_of_file(str(source), text) if written_in is None else dialect_given(written_in)
    path = reader.toolpath(text, str(source), start=pose)
    inverse = inverse_of(
        model,
        known,
        time_s=time_s,
        largest_mm=largest_correction_mm,
        prefer=prefer,
        strict=strict,
    )
    own = inverse.model.machine
    now = own if machine is None else read_machine(Path(machine))
    check_model_is_of(now, own)
    refuse_second_correction(now)
    telling = Telling(say=say)
    warnings = () if inverse.identified is None else model_warnings(inverse.identified)
    telling.note(*warnings)
    if not path.units_said:
        telling.note(UNITS_NOT_SAID)
    origin = origin_of({"program file": source}, inverse, provenance())
    done = compensated_program(path, writer, inverse, chord_mm=chord_um / 1e3, origin=origin)
    if out is not None:
        write_text(Path(out), done.text, force=force)
    digest = sha256_of(Path(model)) if isinstance(model, str | PathLike) else None
    return programs_result(
        [(str(out or done.name), done)], writer, inverse.model.machine, digest, tuple(telling.notes), warnings
    )
