"""Programs of a plan's circles, nominal or compensated."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.counted import counting, uncounted
from dbbstation.errors import StationError
from dbbstation.machine.geometry import check_model_is_of
from dbbstation.nc.circle_program import CLEARANCE_MM, STEP_DEG, chord_error_mm, circle_toolpath
from dbbstation.nc.compensate import Prefer
from dbbstation.nc.curve import rounding_mm
from dbbstation.nc.export import named, planner_of, written_program
from dbbstation.nc.limits import CIRCLE_CHORD_MM
from dbbstation.nc.reach import check_feeds, check_reach
from dbbstation.plan.plan import chosen_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.computing.counted import Counted
    from dbbstation.machine.geometry import Machine
    from dbbstation.nc.dialect import Dialect
    from dbbstation.nc.export import Inverse, Program
    from dbbstation.nc.planner import Planner
    from dbbstation.plan.plan import Circle, Plan


def circle_programs(
    plan: Plan,
    machine: Machine,
    dialect: Dialect,
    *,
    inverse: Inverse | None = None,
    origin: Mapping[str, str] | None = None,
    tests: Sequence[str] = (),
    step_deg: float = STEP_DEG,
    chord_mm: float = CIRCLE_CHORD_MM,
    clearance_mm: float | None = CLEARANCE_MM,
    progress: Counted = uncounted,
) -> list[Program]:
    """Return the programs of all runs, named TEST-DIRECTION with the dialect's extension.

    Args:
        inverse: None for nominal programs.
        step_deg: angle between points; compensated programs use a larger one if the feed needs it.
        chord_mm: greatest distance of a compensated move from the circle.

    Raises:
        TravelError: a program leaves the travel; none is returned then.
        ModelError: the model is of another nominal machine, or has a source that needs data that a program lacks.
        StationError: a test that the plan does not have, or a circle that `strict` refuses.
    """
    if inverse is not None:
        check_model_is_of(machine, inverse.model.machine)
    runs = plan.runs(chosen_of(plan.name, plan.tests, tests, ()))
    programs: list[Program] = []
    for number, ((name, direction), circle) in enumerate(counting(runs.items(), progress), 1):
        title = f"test {name} {direction}"

        step = step_deg
        if inverse is not None and inverse.prefer is Prefer.ACCURACY:
            step = _step_deg(circle, step_deg, chord_mm, planner_of(machine, dialect))
        path = replace(circle_toolpath(circle, title, step_deg=step, clearance_mm=clearance_mm), run=number)
        rounding_um = 1e3 * rounding_mm(dialect.decimals)
        header = _circle_header(title, circle, step, {"plan": plan.name, "machine": machine.name}, rounding_um)
        header += named(origin or {})
        programs.append(
            written_program(path, machine, dialect, f"{name}-{direction}", inverse, chord_mm, header, split=False)
        )
    return programs


def dry_run(
    plan: Plan,
    machine: Machine,
    *,
    tests: Sequence[str] = (),
    step_deg: float = STEP_DEG,
    clearance_mm: float | None = CLEARANCE_MM,
    progress: Counted = uncounted,
) -> tuple[int, list[StationError]]:
    """Check the nominal programs of all runs of a plan without writing them."""
    runs = plan.runs(tests)
    faults: list[StationError] = []
    for (name, direction), circle in counting(runs.items(), progress):
        path = circle_toolpath(circle, f"test {name} {direction}", step_deg=step_deg, clearance_mm=clearance_mm)
        for check in (check_reach, check_feeds):
            try:
                check(machine, path)
            except StationError as error:
                faults.append(error)
    return len(runs), faults


def _step_deg(circle: Circle, step_deg: float, chord_mm: float, planner: Planner) -> float:
    """Return the angle between points of a compensated circle [deg]: at least `step_deg`, or more if the feed needs it, within the chord error."""
    # The arc is divided evenly: its steps may be smaller by a part in its number of points.
    needed_mm = 1.01 * float(planner.needed_mm(np.array(circle.feed_mm_min / 60.0)))
    longest_mm = float(np.sqrt(8.0 * circle.radius_mm * chord_mm)) / 1.01
    return max(step_deg, float(np.degrees(min(needed_mm, longest_mm) / circle.radius_mm)))


def _circle_header(
    name: str, circle: Circle, step_deg: float, names: Mapping[str, str], rounding_um: float
) -> list[str]:
    chord_um = 1e3 * chord_error_mm(circle, step_deg)
    return [
        f"ball-bar run: {name}",
        *named(names),
        f"bar {circle.bar_mm:g} mm, circle of radius {circle.radius_mm:.6f} mm about "
        + " ".join(f"{axis}{value:.6f}" for axis, value in zip("XYZ", circle.centre_mm, strict=True)),
        f"a point every {step_deg:g} deg: chord error {chord_um:.3f} um, rounding at most {rounding_um:.2g} um",
        "coordinates are the machine's: work offsets and tool length must be zero",
    ]
