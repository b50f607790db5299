"""Write one NC program for each test and direction of a plan."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from dbbstation.files.inputs import in_a_book
from dbbstation.nc.limits import CIRCLE_CHORD_MM, LARGEST_CORRECTION_MM
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import File, Option, task
from dbbstation.tasks.telling import Telling

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Unpack

    from dbbstation.files.provenance import Provenance
    from dbbstation.results.programs import ProgramsResult
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.telling import Hooks


@task("program", label="programs")
@in_a_book
def program(
    *,
    plan: o.Plan,
    machine: o.Machine,
    out: Annotated[File, Option(o.OUTPUTS["out"], kind="folder", metavar="FOLDER")],
    dialect: o.Dialect = "linuxcnc",
    model: o.Model | None = None,
    source_files: o.SourceFiles = (),
    tests: o.Tests = (),
    exclude: o.Exclude = (),
    step_deg: o.StepDeg = 0.1,
    clearance_mm: o.ClearanceMm = 20.0,
    bar_stays_on: o.BarStaysOn = False,
    chord_um: Annotated[float, o.CHORD_UM] = 1e3 * CIRCLE_CHORD_MM,
    prefer: o.Prefer = "accuracy",
    strict: o.Strict = False,
    time_s: o.TimeS = None,
    largest_correction_mm: o.LargestCorrectionMm = LARGEST_CORRECTION_MM,
    force: o.Force = False,
    known: Mapping[str, ErrorSource] | None = None,
    provenance: Callable[[], Provenance] | None = None,
    **hooks: Unpack[Hooks],
) -> ProgramsResult:
    r"""Write the NC programs of a plan's circles, one for each test and direction, nominal or compensated.

    Every program is checked against the travel of axes, angles and struts before anything is written; all programs
    are written or none. Each program moves above its first point and down to it. The program waits until the bar is on,
    runs the path, and waits until the bar is off.

    With --model programs are compensated. Points are as far apart as the control needs to keep the feed, within
    --chord-um. If this bound makes the control slower, the output states roughly how much. --strict refuses the program
    instead.

    \b
    Examples:
      dbbstation program --plan table2.yaml --machine machine.yaml --out nominal
      dbbstation program --plan table2.yaml --machine machine.yaml --model model.yaml --out compensated
      dbbstation program --plan table2.yaml --machine machine.yaml --tests a,f --out two --json

    Args:
        known: error sources by name; None: those of package, installed packages and `source_files`.
        provenance: called once all is read; None: from Python.
        stop: asked after each program.

    Raises:
        ArgumentError: a value that it does not take.
        InputError: every fault of the files.
        TravelError: a program leaves the machine's travel.
        ModelError: the model is of another machine, or has a source that needs what a program lacks.
        StationError: `strict` refuses a circle.
        OutputError: a program exists without `force`.
        StoppedError: `stop` returned True; nothing was written.
    """
    from dbbstation.files.atomic import write_folder
    from dbbstation.files.formats.machine import read_machine
    from dbbstation.files.formats.plan import read_plan
    from dbbstation.files.own_dialects import dialect_given
    from dbbstation.files.provenance import from_python
    from dbbstation.machine.geometry import refuse_second_correction
    from dbbstation.nc.circle_programs import circle_programs
    from dbbstation.plan.plan import chosen_of
    from dbbstation.results.model_warnings import model_warnings
    from dbbstation.results.programs import programs_result
    from dbbstation.tasks.models import sources_known
    from dbbstation.tasks.programs import inverse_of, origin_of, sha256_of

    telling = Telling(**hooks)
    written_in, plan_file, machine_file, folder = dialect_given(dialect), Path(plan), Path(machine), Path(out)
    tests_of, hexapod = read_plan(plan_file), read_machine(machine_file)
    inverse = None
    if model is not None:
        refuse_second_correction(hexapod)
        inverse = inverse_of(
            model,
            sources_known(known, source_files),
            time_s=time_s,
            largest_mm=largest_correction_mm,
            prefer=prefer,
            strict=strict,
        )
    warnings = () if inverse is None or inverse.identified is None else model_warnings(inverse.identified)
    telling.note(*warnings)
    programs = circle_programs(
        tests_of,
        hexapod,
        written_in,
        inverse=inverse,
        origin=origin_of(
            {"plan file": plan_file, "machine file": machine_file}, inverse, (provenance or from_python)()
        ),
        tests=chosen_of(tests_of.name, tests_of.tests, tests, exclude),
        step_deg=step_deg,
        chord_mm=chord_um / 1e3,
        clearance_mm=None if bar_stays_on else clearance_mm,
        progress=telling.counted("programs"),
    )
    write_folder(folder, {each.file: each.text for each in programs}, force=force)
    written = [replace(each, file=str(folder / each.file)) for each in programs]
    digest = sha256_of(Path(model)) if isinstance(model, str | PathLike) else None
    return programs_result(
        written, written_in, None if inverse is None else hexapod, digest, tuple(telling.notes), warnings
    )
