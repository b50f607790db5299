"""Programs of a plan's circles and compensated programs, checked against the machine's travel, as text."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import ModelError, StationError
from dbbstation.nc.circle_program import STEP_DEG, USUAL_APPROACH, chord_error_mm, circle_toolpath
from dbbstation.nc.compensate import CHORD_MM, compensate_toolpath
from dbbstation.nc.reach import check_reach

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.machine.geometry import Machine
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
    """

    model: MachineModel
    origin: Mapping[str, str] = field(default_factory=dict)
    started_s: float | None = None


@dataclass(frozen=True)
class Program:
    """A program ready to be written.

    Attributes:
        name: file name.
        text: the program.
        points: moves at feed.
        greatest_um: largest correction of a programmed point [µm]; None in a nominal program.
        chord_um: largest chord error that splitting left [µm]; None where nothing was split.
    """

    name: str
    text: str
    points: int
    greatest_um: float | None = None
    chord_um: float | None = None


COMPENSATED = "compensated, greatest correction"
"""How a header says that a program is compensated: nobody should do that twice."""


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

    Raises:
        TravelError: a program leaves the travel; none is returned then.
        ModelError: the model is of another nominal machine, or has a source that needs what a program lacks.
        StationError: a test that the plan does not have.
    """
    if inverse is not None:
        _check_same_machine(machine, inverse.model.machine)
    unknown = [name for name in tests if name not in plan.tests]
    if unknown:
        known = ", ".join(plan.tests)
        raise StationError(f"the plan has no test {', '.join(unknown)}", where=plan.name, remedy=f"it has {known}")
    programs = []
    for name in tests or plan.tests:
        test = plan.tests[name]
        for direction in test.directions:
            circle = test.run(direction)
            path = circle_toolpath(circle, f"test {name} {direction}", step_deg=step_deg, approach=approach)
            header = _circle_header(path.name, circle, step_deg, {"plan": plan.name, "machine": machine.name})
            header += _said(origin or {})
            programs.append(_program(path, machine, dialect, f"{name}-{direction}", inverse, None, header))
    return programs


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
        StationError: the program says that it is compensated already.
    """
    if any(text.startswith(COMPENSATED) for text in path.text.values()):
        what = "this program is compensated already"
        raise StationError(what, where=path.name, remedy="compensate the nominal program that it was made from")
    machine = inverse.model.machine
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
    if inverse is None:
        return Program(name, dialect.write(path, header), _points(path))
    done = compensate_toolpath(path, inverse.model, chord_mm=chord_mm, started_s=inverse.started_s)
    check_reach(machine, done.toolpath)
    header = [*header, *_said(inverse.origin), f"{COMPENSATED} {done.greatest_um:.3f} um"]
    if done.chord_um is not None:
        header.append(f"moves split to keep a chord error of {1e3 * (chord_mm or 0.0):g} um")
    return Program(name, dialect.write(done.toolpath, header), _points(done.toolpath), done.greatest_um, done.chord_um)


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


def _check_same_machine(machine: Machine, other: Machine) -> None:
    """Refuse a model whose nominal machine is not the one that the programs are for."""
    same = (
        np.array_equal(machine.hexapod.base_joints_mm, other.hexapod.base_joints_mm)
        and np.array_equal(machine.hexapod.platform_joints_mm, other.hexapod.platform_joints_mm)
        and machine.hexapod.rotation == other.hexapod.rotation
        and np.array_equal(machine.reference_length_error_mm, other.reference_length_error_mm)
    )
    if not same:
        raise ModelError(
            f"the model was calibrated on another nominal machine ({other.name}) than {machine.name}",
            remedy="give the machine file that its sessions were recorded with",
        )
