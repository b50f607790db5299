"""From a plan to one NC program for each test and direction."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dbbstation.files.atomic import write_folder
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.inputs import in_a_book
from dbbstation.files.own_dialects import dialect_given
from dbbstation.nc.circle_program import Approach
from dbbstation.nc.export import circle_programs
from dbbstation.nc.limits import CIRCLE_CHORD_MM, LARGEST_CORRECTION_MM
from dbbstation.results.model_warnings import model_warnings
from dbbstation.results.programs import programs_result
from dbbstation.tasks.chosen import chosen_of
from dbbstation.tasks.programs import inverse_of, origin_of, sha256_of
from dbbstation.tasks.provenance import from_python
from dbbstation.tasks.telling import Telling, never, silent

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from os import PathLike

    from dbbstation.files.provenance import Provenance
    from dbbstation.results.programs import ProgramsResult
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.telling import Progress

STEP_DEG = 0.1
"""Angle between points where nobody says another [deg]."""

CLEARANCE_MM = 20.0
"""Height of rapid moves above the first point where nobody says another [mm]."""


@in_a_book
def write_circle_programs(
    plan_file: Path,
    machine_file: Path,
    out: str | PathLike[str],
    *,
    dialect: str = "linuxcnc",
    model: Path | None = None,
    tests: Sequence[str] = (),
    exclude: Sequence[str] = (),
    step_deg: float = STEP_DEG,
    clearance_mm: float | None = CLEARANCE_MM,
    chord_um: float = 1e3 * CIRCLE_CHORD_MM,
    prefer: str = "accuracy",
    strict: bool = False,
    time_s: float | None = None,
    largest_correction_mm: float = LARGEST_CORRECTION_MM,
    force: bool = False,
    known: Mapping[str, ErrorSource] | None = None,
    provenance: Callable[[], Provenance] = from_python,
    progress: Progress = silent,
    stop: Callable[[], bool] = never,
    say: Callable[[str], None] = silent,
) -> ProgramsResult:
    """Write the programs of a plan's circles, all or none, checked against the travel.

    Args:
        dialect: a name, or a Python file.
        model: file; None: nominal programs.
        tests: names; empty for all.
        clearance_mm: height of rapids above the first point; None: the bar stays on, without rapids and stops.
        chord_um: greatest distance of a compensated move from the circle.
        prefer: `accuracy`, or `position-only` to leave A, B and C as they are.
        strict: refuse programs that miss the chord error or a feed.
        time_s: start of the programs after the session's, for models that depend on time.
        largest_correction_mm: models that shift a point by more are refused.

    Raises:
        InputError: every fault of the files.
        TravelError: a program leaves the machine's travel.
        ModelError: the model is of another machine, or has a source that needs what a program lacks.
        StationError: `strict` refuses a circle.
        OutputError: a program exists without `force`.
        StoppedError: `stop` returned True; nothing was written.
    """
    telling = Telling(progress, stop, say)
    written_in = dialect_given(dialect)
    plan, machine = read_plan(plan_file), read_machine(machine_file)
    inverse = None
    if model is not None:
        inverse = inverse_of(
            model,
            known,
            time_s=time_s,
            largest_mm=largest_correction_mm,
            prefer=prefer,
            strict=strict,
        )
    warnings = () if inverse is None or inverse.identified is None else model_warnings(inverse.identified)
    telling.note(*warnings)
    programs = circle_programs(
        plan,
        machine,
        written_in,
        inverse=inverse,
        origin=origin_of({"plan file": plan_file, "machine file": machine_file}, inverse, provenance()),
        tests=chosen_of(plan.name, plan.tests, tests, exclude),
        step_deg=step_deg,
        chord_mm=chord_um / 1e3,
        approach=None if clearance_mm is None else Approach(clearance_mm),
        progress=telling.counted("programs"),
    )
    folder = Path(out)
    write_folder(folder, {each.name: each.text for each in programs}, force=force)
    written = [(str(folder / each.name), each) for each in programs]
    digest = None if model is None else sha256_of(model)
    return programs_result(
        written, written_in, None if inverse is None else machine, digest, tuple(telling.notes), warnings
    )
