"""`dbbstation program`: NC programs of a plan's circles; `dbbstation compensate`: any NC program through a model's inverse."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.declared import command
from dbbstation.cli.output import print_table, say
from dbbstation.tasks.circle_programs import program as program_task
from dbbstation.tasks.compensate import compensate as compensate_task

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dbbstation.nc.export import Program
    from dbbstation.results.programs import ProgramsResult


def print_programs(result: ProgramsResult) -> None:
    """Print programs as a table, with the assumed acceleration."""
    rows = [
        [
            each.file,
            each.points,
            each.greatest_correction_um,
            "unknown" if each.model_uncertainty_not_known_because else each.model_uncertainty_um,
            each.chord_error_um,
            each.feed_s,
            each.nominal_feed_s,
        ]
        for each in result.programs
    ]
    correction = ["greatest correction / µm", "model's u along the path / µm"]
    print_table(["program", "points", *correction, "chord error / µm", "time at feed / s", "nominal / s"], rows)
    for each in result.programs:
        for told in each.remarks:
            say(f"{each.file}: {told}")
    if result.acceleration_mm_s2 is not None:
        say(f"the lengths of pieces suit {result.dialect} with {result.acceleration_in_words}")
    _say_uncertainty(result.programs)


def _say_uncertainty(programs: Sequence[Program]) -> None:
    reasons = [each.model_uncertainty_not_known_because for each in programs]
    for why in dict.fromkeys(one for one in reasons if one):
        unsure = [each for each, one in zip(programs, reasons, strict=True) if one == why]
        written_um = max(each.greatest_correction_um or 0.0 for each in unsure)
        by_axis = [(axis, u) for each in unsure for axis, u in (each.model_uncertainty_by_axis_um or {}).items()]
        axes = {axis.upper() for axis, u in by_axis if u is None}
        say(
            f"corrections of up to {written_um:.0f} µm whose uncertainty in {', '.join(sorted(axes))} is unknown: {why}; "
            "measure more tests before cutting"
        )
    known = [each.model_uncertainty_um for each in programs if each.model_uncertainty_um is not None]
    asked_um = next((each.chord_asked_um for each in programs if each.chord_asked_um is not None), None)
    if not known or asked_um is None:
        return
    uncertain_um = max(known)
    knows = f"the model knows the path within {uncertain_um:.2g} µm (standard uncertainty)"
    asked = f"the chord error asked for is {asked_um:g} µm"
    if uncertain_um > asked_um:
        asked += ": moves are split finer than the model knows them"
    say(f"{knows}, {asked}")


def show(result: ProgramsResult, out: Path) -> None:
    """Print the written programs."""
    print_programs(result)
    say(f"{len(result.programs)} programs written to {out}, all within the machine's travel")


program = command(program_task, show)
compensate = command(compensate_task, print_programs)
