"""Compensate any NC program with a calibrated model."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from dbbstation.files.inputs import in_a_book
from dbbstation.nc.limits import CHORD_MM, LARGEST_CORRECTION_MM
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import File, Option, task
from dbbstation.tasks.options import lengths_by_tool, named_numbers, numbers_of
from dbbstation.tasks.telling import Telling, silent

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import ArrayLike

    from dbbstation.files.provenance import Provenance
    from dbbstation.results.programs import ProgramsResult
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.programs import ProgramText

    Source: TypeAlias = File | ProgramText
    Numbers = ArrayLike
    Offsets = Mapping[str, Sequence[float]]
    Lengths = Mapping[int, float]
else:
    Source, Numbers, Offsets, Lengths = Any, str, tuple[str, ...], tuple[str, ...]

UNITS_NOT_SAID = (
    "the program says neither G20 nor G21: its lengths are taken for millimetres; a control that still has inches from the program before "
    "would run it 25.4 times as large"
)


OLDER = "the {} is older than the program: its values may be from before the last touch-off"


@task("compensate", label="compensation")
@in_a_book
def compensate(
    program: Annotated[Source, Option("NC program, or `Program(text)`.", kind="argument-file", metavar="PROGRAM")],
    model: o.Model,
    out: Annotated[File | None, Option(o.OUTPUTS["out"], kind="file", required=True)] = None,
    *,
    source_files: o.SourceFiles = (),
    dialect: o.Dialect = "linuxcnc",
    written_in: Annotated[
        str | None, Option("NC language of PROGRAM: a name, or FILE.py [default: by its extension].", metavar="D")
    ] = None,
    start: Annotated[
        Numbers | None,
        Option(
            "Machine coordinates of the pose before the program [mm, deg].",
            metavar="X,Y,Z,A,B,C",
            parse=partial(numbers_of, counts={6}),
        ),
    ] = None,
    angles_deg: Annotated[
        Numbers | None,
        Option(
            "Angles at which a program of three axes runs [deg].",
            metavar="A,B,C",
            parse=partial(numbers_of, counts={3}),
        ),
    ] = None,
    offsets: Annotated[
        Offsets | None,
        Option(
            "Work offset in the control, G54 to G59.3 or G92, or position of G28 or G30 [mm]. A, B, C may follow [default: zero].",
            metavar="G54=X,Y,Z",
            parse=partial(named_numbers, counts={3, 6}),
        ),
    ] = None,
    parameters: Annotated[
        File | None, Option("LinuxCNC's parameter file, for offsets and positions that no option states.", kind="file")
    ] = None,
    tool_lengths_mm: Annotated[
        Lengths | None,
        Option(
            "Length of a tool in the control, for G43 [mm].",
            metavar="TOOL=MM",
            parse=lengths_by_tool,
        ),
    ] = None,
    tools: Annotated[
        File | None, Option("LinuxCNC's tool table, for lengths that no option states.", kind="file")
    ] = None,
    subprograms: Annotated[
        File | None, Option("Folder of subprograms that the program calls and does not contain.", kind="folder")
    ] = None,
    block_delete: Annotated[
        Literal["on", "off"] | None,
        Option("State of the control's block-delete switch; if it is on, lines that begin with a slash are skipped."),
    ] = None,
    chord_um: Annotated[float, replace(o.CHORD_UM, setting="program.chord_um")] = 1e3 * CHORD_MM,
    prefer: o.Prefer = "accuracy",
    strict: o.Strict = False,
    unexplained: Annotated[
        bool, Option("Also correct an error of unknown cause, if a diagnosis kept one in the model.")
    ] = False,
    time_s: o.TimeS = None,
    largest_correction_mm: o.LargestCorrectionMm = LARGEST_CORRECTION_MM,
    machine: Annotated[File | None, replace(o.MACHINE, kind="file")] = None,
    force: o.Force = False,
    known: Mapping[str, ErrorSource] | None = None,
    provenance: Callable[[], Provenance] | None = None,
    say: Callable[[str], None] = silent,
) -> ProgramsResult:
    r"""Compensate an NC program, so that the real machine follows PROGRAM.

    Moves at feed are split into the longest pieces that keep the chord error. If such pieces make the control slower,
    the output states roughly how much. --strict refuses the program instead.

    State the control's work offsets and tool lengths, or name its files. If the program names X, Y and Z only, state
    the angles too. The result is right for these values only. Its first lines stop LinuxCNC if other values are active.

    The program must be complete (with M2, M30 or percent signs), uncompensated, and made for the model's machine.
    Travel, feeds and the size of corrections are checked before anything is written. With --machine, the command
    refuses a machine that its control already corrects.

    \b
    Examples:
      dbbstation compensate part.ngc --model model.yaml --out part-compensated.ngc
      dbbstation compensate block.ngc --model model.yaml --out true.ngc --angles-deg 0,0,0 --offsets G54=20,-35,-1000 --tool-lengths-mm 1=52.1
      dbbstation compensate block.ngc --model model.yaml --out true.ngc --angles-deg 0,0,0 --parameters linuxcnc.var --tools tool.tbl
      dbbstation compensate part.ngc --model model.yaml --out true.ngc --strict

    Args:
        known: error sources by name; None: those of package, installed packages and `source_files`.
        provenance: called for the header after all reading; None: from Python.

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
    import numpy as np

    from dbbstation.files.atomic import refuse_existing
    from dbbstation.files.formats.machine import read_machine
    from dbbstation.files.own_dialects import dialect_given
    from dbbstation.files.provenance import from_python
    from dbbstation.machine.geometry import check_model_is_of, refuse_second_correction
    from dbbstation.nc.export import compensated_program
    from dbbstation.nc.registry import dialect_of_file
    from dbbstation.results.model_warnings import model_warnings
    from dbbstation.results.programs import programs_result, write_programs
    from dbbstation.tasks.models import sources_known
    from dbbstation.tasks.programs import (
        NOT_CORRECTED,
        ProgramText,
        inverse_of,
        origin_of,
        program_of,
        setup_of,
        sha256_of,
        source_of,
    )

    source = source_of(program)
    name = source.name if isinstance(source, ProgramText) else str(source)
    pose = np.full(6, np.nan) if start is None else np.array(start, dtype=np.float64).reshape(6)
    if angles_deg is not None:
        pose[3:] = np.asarray(angles_deg, dtype=np.float64).reshape(3)
    both = (("parameter file", parameters), ("tool table", tools))
    files = {what: Path(file) for what, file in both if file is not None}
    three = [None if file is None else Path(file) for file in (parameters, tools, subprograms)]
    declared = bool(offsets or tool_lengths_mm or any(three) or block_delete is not None)
    setup = setup_of(offsets or {}, tool_lengths_mm or {}, *three, block_delete=block_delete) if declared else None
    if out is not None:
        refuse_existing(Path(out), force=force)
    writer = dialect_given(dialect)
    text = program_of(source)
    reader = dialect_of_file(name, text) if written_in is None else dialect_given(written_in)
    path = reader.toolpath(text, name, start=None if np.isnan(pose).all() else pose, setup=setup)
    inverse = inverse_of(
        model,
        sources_known(known, source_files),
        time_s=time_s,
        largest_mm=largest_correction_mm,
        prefer=prefer,
        strict=strict,
        unexplained=unexplained,
    )
    now = inverse.model.machine if machine is None else read_machine(Path(machine))
    check_model_is_of(now, inverse.model.machine)
    refuse_second_correction(now)
    telling = Telling(say=say)
    left_out = (name for key, name in inverse.origin.items() if key.startswith(NOT_CORRECTED))
    telling.note(
        *(f"the cause of {name} is unknown, and it is not corrected; --unexplained corrects it" for name in left_out)
    )
    warnings = () if inverse.identified is None else model_warnings(inverse.identified)
    telling.note(*warnings)
    telling.note(*([] if path.units_said else [UNITS_NOT_SAID]))
    named = {"program file": source} if isinstance(source, Path) else {}
    older = min((one.stat().st_mtime for one in named.values()), default=0.0)
    telling.note(*(OLDER.format(what) for what, file in files.items() if file.stat().st_mtime < older))
    called = {f"subprogram {Path(file).stem}": Path(file) for _, file in path.files[1:]}
    origin = origin_of({**named, **files, **called}, inverse, (provenance or from_python)())
    done = compensated_program(path, writer, inverse, chord_mm=chord_um / 1e3, origin=origin)
    if out is not None:
        write_programs(Path(out), [done.content], force=force)
    digest = sha256_of(Path(model)) if isinstance(model, str | PathLike) else None
    return programs_result(
        [replace(done, file=str(out or done.file))],
        writer,
        inverse.model.machine,
        digest,
        tuple(telling.notes),
        warnings,
    )
