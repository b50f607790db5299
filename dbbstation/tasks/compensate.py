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
from dbbstation.files.provenance import from_python
from dbbstation.machine.difference import check_model_is_of
from dbbstation.nc.compensate import CHORD_MM
from dbbstation.nc.export import compensated_program
from dbbstation.nc.limits import LARGEST_CORRECTION_MM
from dbbstation.nc.registry import dialect_of_file
from dbbstation.results.model_warnings import model_warnings
from dbbstation.results.programs import ProgramsResult, programs_result
from dbbstation.tasks.programs import (
    NOT_CORRECTED,
    ProgramText,
    inverse_of,
    origin_of,
    program_text,
    setup_of,
    sha256_of,
)
from dbbstation.tasks.telling import Telling, silent

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import ArrayLike

    from dbbstation.files.provenance import Provenance
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.models import Model


UNITS_NOT_SAID = (
    "the program says neither G20 nor G21: its lengths are taken for millimetres; a control that still has inches from the program before "
    "would run it 25.4 times as large"
)


OLDER = "the {} is older than the program: its values may be from before the last touch-off"


@in_a_book
def compensate(
    program: str | PathLike[str] | ProgramText,
    model: Model,
    out: str | PathLike[str] | None = None,
    *,
    dialect: str = "linuxcnc",
    written_in: str | None = None,
    start: ArrayLike | None = None,
    angles_deg: ArrayLike | None = None,
    offsets: Mapping[str, Sequence[float]] | None = None,
    parameters: str | PathLike[str] | None = None,
    tool_lengths_mm: Mapping[int, float] | None = None,
    tools: str | PathLike[str] | None = None,
    chord_um: float = 1e3 * CHORD_MM,
    prefer: str = "accuracy",
    strict: bool = False,
    unexplained: bool = False,
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
        program: file, or `Program(text)`, whole, not compensated, of no other machine.
        model: a model, its file, or the result of `calibrate` or `diagnose`.
        out: file; None: only the text in the result.
        dialect: to write: a name, or a Python file.
        written_in: dialect of `program`; None: by its extension.
        start: pose before the program in machine coordinates, X, Y, Z [mm], A, B, C [deg]; None: its first rapids tell.
        angles_deg: A, B, C at which a program of three axes runs; None: it names them.
        offsets: `G54` to `G59.3`, `G92`, `G28`, `G30` of the control, X, Y, Z or X to C [mm, deg]; work offsets not given are zero.
        parameters: LinuxCNC's parameter file, for offsets not given.
        tool_lengths_mm: by number of the tool, for G43.
        tools: LinuxCNC's tool table, for lengths not given.
        chord_um: greatest distance of a move from the path.
        prefer: `accuracy`, or `position-only` to leave A, B and C as they are.
        strict: refuse a program that misses the chord error or a feed.
        unexplained: correct an error of unknown cause, too, that a diagnosis kept in the model.
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
        ValueError: an unknown `prefer` or offset, or `start` is no pose.
    """
    source = program if isinstance(program, ProgramText) else Path(program)
    name = source.name if isinstance(source, ProgramText) else str(source)
    pose = np.full(6, np.nan) if start is None else np.array(start, dtype=np.float64).reshape(6)
    if angles_deg is not None:
        pose[3:] = np.asarray(angles_deg, dtype=np.float64).reshape(3)
    files = {
        what: Path(file) for what, file in (("parameter file", parameters), ("tool table", tools)) if file is not None
    }
    setup = None
    if offsets or tool_lengths_mm or files:
        setup = setup_of(offsets or {}, tool_lengths_mm or {}, files.get("parameter file"), files.get("tool table"))
    if out is not None:
        refuse_existing(Path(out), force=force)
    writer = dialect_given(dialect)
    text = program_text(source)
    reader = dialect_of_file(name, text) if written_in is None else dialect_given(written_in)
    path = reader.toolpath(text, name, start=None if np.isnan(pose).all() else pose, setup=setup)
    inverse = inverse_of(
        model,
        known,
        time_s=time_s,
        largest_mm=largest_correction_mm,
        prefer=prefer,
        strict=strict,
        unexplained=unexplained,
    )
    own = inverse.model.machine
    now = own if machine is None else read_machine(Path(machine))
    check_model_is_of(now, own)
    refuse_second_correction(now)
    telling = Telling(say=say)
    left_out = (name for key, name in inverse.origin.items() if key.startswith(NOT_CORRECTED))
    telling.note(
        *(f"the cause of {name} is unknown, and it is not corrected; --unexplained corrects it" for name in left_out)
    )
    warnings = () if inverse.identified is None else model_warnings(inverse.identified)
    telling.note(*warnings)
    if not path.units_said:
        telling.note(UNITS_NOT_SAID)
    named = {"program file": source} if isinstance(source, Path) else {}
    older = min((one.stat().st_mtime for one in named.values()), default=0.0)
    telling.note(*(OLDER.format(what) for what, file in files.items() if file.stat().st_mtime < older))
    origin = origin_of({**named, **files}, inverse, provenance())
    done = compensated_program(path, writer, inverse, chord_mm=chord_um / 1e3, origin=origin)
    if out is not None:
        write_text(Path(out), done.text, force=force)
    digest = sha256_of(Path(model)) if isinstance(model, str | PathLike) else None
    return programs_result(
        [(str(out or done.name), done)], writer, inverse.model.machine, digest, tuple(telling.notes), warnings
    )
