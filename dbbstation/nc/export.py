"""Programs of a plan's circles and compensated programs, checked against the machine's travel, as text."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import StationError
from dbbstation.machine.difference import check_model_is_of
from dbbstation.machine.regularity import check_joints
from dbbstation.model.uncertainty import position_uncertainty_mm
from dbbstation.nc.circle_program import STEP_DEG, USUAL_APPROACH, chord_error_mm, circle_toolpath
from dbbstation.nc.compensate import CHORD_MM, compensate_toolpath
from dbbstation.nc.limits import LARGEST_CORRECTION_MM
from dbbstation.nc.mark import marked
from dbbstation.nc.nominal import COMPENSATED, check_machine, check_nominal, checksum
from dbbstation.nc.reach import STEP_DEG as REACH_DEG
from dbbstation.nc.reach import STEP_MM as REACH_MM
from dbbstation.nc.reach import check_feeds, check_reach
from dbbstation.nc.systems import in_systems
from dbbstation.sources.contract import Motion

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from dbbstation.machine.geometry import Machine
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.model.machine_model import MachineModel
    from dbbstation.nc.circle_program import Approach
    from dbbstation.nc.dialect import Dialect
    from dbbstation.nc.toolpath import Toolpath
    from dbbstation.plan.circle import Circle
    from dbbstation.plan.plan import Plan


@dataclass(frozen=True)
class Inverse:
    """The model to compensate with.

    Attributes:
        model: calibrated model.
        origin: where it comes from, for the header: what by which name or hash.
        started_s: start of each program on the time scale of the model's sessions [s]; None where not known.
        identified: the same model with the covariance of its values; None where that is not known.
        largest_mm: greatest correction that is applied [mm].
    """

    model: MachineModel
    origin: Mapping[str, str] = field(default_factory=dict)
    started_s: float | None = None
    identified: IdentifiedModel | None = None
    largest_mm: float = LARGEST_CORRECTION_MM


@dataclass(frozen=True)
class Program:
    """A program ready to be written.

    Attributes:
        name: file name.
        text: the program.
        points: moves at feed.
        greatest_um: largest correction of a programmed point [µm]; None in a nominal program.
        chord_um: largest chord error that splitting left [µm]; None where nothing was split.
        chord_asked_um: chord error that was asked for [µm]; None where nothing was split.
        uncertainty_um: greatest standard uncertainty of the model's tool tip along the path [µm]; None where not known.
    """

    name: str
    text: str
    points: int
    greatest_um: float | None = None
    chord_um: float | None = None
    chord_asked_um: float | None = None
    uncertainty_um: float | None = None


def circle_programs(
    plan: Plan,
    machine: Machine,
    dialect: Dialect,
    *,
    inverse: Inverse | None = None,
    origin: Mapping[str, str] | None = None,
    tests: Sequence[str] = (),
    step_deg: float = STEP_DEG,
    approach: Approach | None = USUAL_APPROACH,
    progress: Callable[[int, int], None] = lambda _done, _of: None,
) -> list[Program]:
    """Return the programs of all runs of a plan, named TEST-DIRECTION with the dialect's extension.

    Args:
        plan: the tests.
        machine: nominal machine, whose travel holds.
        dialect: to write in.
        inverse: compensate with this; None for nominal programs.
        origin: where plan and machine come from, for the header.
        tests: names of the tests wanted; empty for all.
        step_deg: greatest angle between programmed points [deg].
        approach: see `circle_toolpath`.
        progress: told how many of how many are done.

    Raises:
        TravelError: a program leaves the travel; none is returned then.
        ModelError: the model is of another nominal machine, or has a source that needs what a program lacks.
        StationError: a test that the plan does not have.
    """
    if inverse is not None:
        check_model_is_of(machine, inverse.model.machine)
    unknown = [name for name in tests if name not in plan.tests]
    if unknown:
        known = ", ".join(plan.tests)
        raise StationError(f"the plan has no test {', '.join(unknown)}", where=plan.name, remedy=f"it has {known}")
    runs = [(name, direction) for name in tests or plan.tests for direction in plan.tests[name].directions]
    programs: list[Program] = []
    for name, direction in runs:
        progress(len(programs), len(runs))
        circle = plan.tests[name].run(direction)
        path = circle_toolpath(circle, f"test {name} {direction}", step_deg=step_deg, approach=approach)
        header = _circle_header(path.name, circle, step_deg, {"plan": plan.name, "machine": machine.name})
        header += _said(origin or {})
        programs.append(_program(path, machine, dialect, f"{name}-{direction}", inverse, None, header))
    progress(len(programs), len(runs))
    return programs


def dry_run(
    plan: Plan,
    machine: Machine,
    *,
    tests: Sequence[str] = (),
    step_deg: float = STEP_DEG,
    approach: Approach | None = USUAL_APPROACH,
    progress: Callable[[int, int], None] = lambda _done, _of: None,
) -> tuple[int, list[StationError]]:
    """Try the nominal programs of all runs of a plan, and write none.

    Args:
        plan: the tests.
        machine: nominal machine, whose travel and feeds hold.
        tests: names of the tests wanted, which the plan has; empty for all.
        step_deg: greatest angle between programmed points [deg].
        approach: see `circle_toolpath`.
        progress: told how many of how many are done.

    Returns:
        Number of programs, and what `circle_programs` would refuse: for each program the first point outside the travel and
        the first feed that the machine does not reach.
    """
    runs = [(name, direction) for name in tests or plan.tests for direction in plan.tests[name].directions]
    faults: list[StationError] = []
    for done, (name, direction) in enumerate(runs):
        progress(done, len(runs))
        circle = plan.tests[name].run(direction)
        path = circle_toolpath(circle, f"test {name} {direction}", step_deg=step_deg, approach=approach)
        for check in (check_reach, check_feeds):
            try:
                check(machine, path)
            except StationError as error:
                faults.append(error)
    progress(len(runs), len(runs))
    return len(runs), faults


def compensated_program(
    path: Toolpath,
    dialect: Dialect,
    inverse: Inverse,
    *,
    chord_mm: float = CHORD_MM,
    origin: Mapping[str, str] | None = None,
) -> Program:
    """Return any program compensated, and named after the one that it was.

    Raises:
        TravelError: the compensated path leaves the travel.
        KinematicsError: a pose that the machine cannot take.
        ModelError: the model has a source that needs what a program lacks.
        MachineError: a feed that the machine does not reach.
        StationError: the program is compensated already or for another machine, or its corrections are too large.
    """
    machine = inverse.model.machine
    check_nominal(path)
    check_machine(path, machine)
    header = [f"machine: {machine.name}", *_said(origin or {})]
    return _program(path, machine, dialect, path.name, inverse, chord_mm, header)


def _program(
    path: Toolpath,
    machine: Machine,
    dialect: Dialect,
    stem: str,
    inverse: Inverse | None,
    chord_mm: float | None,
    header: list[str],
) -> Program:
    name = stem if stem.endswith(dialect.extension) else stem + dialect.extension
    check_reach(machine, path)
    check_feeds(machine, path)
    if inverse is None:
        return Program(name, dialect.write(path, header), _points(path))
    check_joints(inverse.model.machine)
    model, started_s = inverse.model, inverse.started_s
    done = compensate_toolpath(path, model, chord_mm=chord_mm, started_s=started_s, largest_mm=inverse.largest_mm)
    check_reach(machine, done.toolpath)
    header = [*header, *_said(inverse.origin), f"{COMPENSATED} {done.greatest_um:.3f} um"]
    asked_um = None if chord_mm is None else 1e3 * chord_mm
    if asked_um is not None:
        header.append(f"moves split to keep a chord error of {asked_um:g} um")
    uncertainty_um = _uncertainty_um(path, inverse)
    if uncertainty_um is not None:
        header.append(f"standard uncertainty of the model along the path {uncertainty_um:.3f} um at most")
    finished = marked(in_systems(done.toolpath))
    number = checksum(finished)
    text = dialect.write(replace(finished, numbers=(number, number)), header)
    return Program(name, text, _points(finished), done.greatest_um, done.chord_um, asked_um, uncertainty_um)


UNCERTAIN_AT = 2000
"""Poses at which the model's uncertainty is taken, spread over the path: it changes over decimetres."""


def _uncertainty_um(path: Toolpath, inverse: Inverse) -> float | None:
    """Greatest standard uncertainty of the tool tip along the path, all three coordinates together [µm]."""
    if inverse.identified is None or not inverse.identified.covariance_rows:
        return None
    row, share = path.subdivided(REACH_MM, REACH_DEG)
    known = ~np.isnan(path.poses[row, 0]) & path.is_move[row]
    row, share = row[known], share[known]
    some = np.unique(np.linspace(0, len(row) - 1, UNCERTAIN_AT).astype(np.int64))
    row, share = row[some], share[some]
    time_s = None
    if inverse.started_s is not None:
        time_s = inverse.started_s + path.end_s[row] - (1.0 - share) * path.duration_s[row]
    motion = Motion(poses=path.between(row, share), is_path=True, time_s=time_s)
    per_axis_mm = position_uncertainty_mm(inverse.identified, motion)
    return 1e3 * float(np.linalg.norm(per_axis_mm, axis=1).max())


def _circle_header(name: str, circle: Circle, step_deg: float, names: Mapping[str, str]) -> list[str]:
    chord_um = 1e3 * chord_error_mm(circle, step_deg)
    return [
        f"ball-bar run: {name}",
        *_said(names),
        f"bar {circle.bar_mm:g} mm, circle of radius {circle.radius_mm:.6f} mm about "
        + " ".join(f"{axis}{value:.6f}" for axis, value in zip("XYZ", circle.centre_mm, strict=True)),
        f"a point every {step_deg:g} deg: chord error {chord_um:.3f} um, rounding below 0.001 um",
        "coordinates are the machine's: work offsets and tool length must be zero",
    ]


def _said(names: Mapping[str, str]) -> list[str]:
    return [f"{what}: {name}" for what, name in names.items()]


def _points(path: Toolpath) -> int:
    return int(np.count_nonzero(path.is_move))
