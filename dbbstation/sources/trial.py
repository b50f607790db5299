"""Test a foreign error source against the interface before its use."""

from __future__ import annotations

import inspect
import re
from dataclasses import fields, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import STRUTS, Compliance, Hexapod, JointAxes, Machine, Masses, StrutMasses, Travel
from dbbstation.machine.travel import middle
from dbbstation.sources.contract import EFFECT_SHAPES, Effect, ErrorSource, Motion, Need, Owner, Parameter, Setup, Texts
from dbbstation.trace.columns import currents, temperatures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats

NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")

STEP = 1e-4
"""Step of the numerical derivative, relative to plausible sizes."""

AGREES = 1e-2
"""Largest difference between derivative and numerical derivative, relative to the greatest value."""

SAME = 1e-9
"""Largest rounding difference between two stretches and the whole, relative to the greatest effect."""

MOST_KINKS = 0.05
"""Largest share of samples with larger differences: at kinks, such as those of play, no derivative exists."""

FEWEST_LETTERS, FEWEST_WORDS = 10, 4
"""Fewest letters of a text and words of a parameter's meaning that help a reader of a verdict."""

OTHER_SIZE = 0.7
"""Second point of the derivative test, relative to plausible sizes; amplitudes are negative."""

ROUNDED = 8.0 * float(np.finfo(np.float64).eps)
"""Relative rounding of a difference of two effects: a few operations with half of eps each."""


@cache
def trial_machine() -> Machine:
    """Return a regular hexapod with all optional data."""
    turn = np.radians(120.0)
    joints_mm = []
    for radius_mm, half_deg, first_deg, height_mm in ((730.0, 5.0, 90.0, 0.0), (395.0, 10.0, 150.0, 500.0)):
        at = np.radians([first_deg - half_deg, first_deg + half_deg])
        at = np.concatenate([at + k * turn for k in range(3)])
        joints_mm.append(np.column_stack([radius_mm * np.cos(at), radius_mm * np.sin(at), np.full(STRUTS, height_mm)]))
    base, platform = joints_mm
    # Struts run from each base joint to the nearest platform joint.
    platform = np.roll(platform, 1, axis=0)
    axes = [np.cross(joints, [0.0, 0.0, 1.0]) for joints in (base, platform)]
    return Machine(
        name="trial",
        hexapod=Hexapod(base, platform),
        travel=Travel(
            300.0,
            (-300.0, 300.0),
            (-300.0, 300.0),
            (-1200.0, -800.0),
            (-20.0, 20.0),
            (-20.0, 20.0),
            (-5.0, 5.0),
            (200.0, 1600.0),
        ),
        screw_lead_mm=10.0,
        masses=Masses(400.0, 500.0),
        joint_tolerance_mm=0.05,
        compliance=Compliance(1e-5),
        strut_masses=StrutMasses(25.0, 20.0, 300.0, 12.0, 1400.0),
        joint_axes=JointAxes(*(each / np.linalg.norm(each, axis=1)[:, None] for each in axes)),
        greatest_feed_mm_min=30_000.0,
        greatest_turn_deg_min=1800.0,
        acceleration_mm_s2=1500.0,
    )


def undeclared(kind: type[ErrorSource]) -> list[str]:
    """Return faults that prevent a class from being instantiated; may be empty."""
    faults = []
    missing = sorted(getattr(kind, "__abstractmethods__", ()))
    if missing:
        faults.append(f"it has no {' and no '.join(missing)}")
    name = getattr(kind, "name", None)
    if not isinstance(name, str) or not NAME.fullmatch(name):
        faults.append("it needs a `name` in small letters with hyphens, such as `screw-lead`")
    if not isinstance(getattr(kind, "belongs_to", None), Owner):
        faults.append("it needs `belongs_to`, one of " + ", ".join(f"Owner.{owner.name}" for owner in Owner))
    needs: object = kind.needs
    if not isinstance(needs, frozenset) or not all(isinstance(need, Need) for need in needs):
        faults.append("its `needs` must be a frozenset of Need")
    detail_mm: object = kind.detail_mm
    if not isinstance(detail_mm, int | float) or not detail_mm > 0.0:
        faults.append("its `detail_mm` must be a length above zero, or SMOOTH_MM")
    share: object = kind.form_uncertainty
    if not isinstance(share, int | float) or not 0.0 <= share < 1.0:
        faults.append("its `form_uncertainty` must be a share of the effect, from 0 to below 1")
    texts = getattr(kind, "texts", None)
    if not isinstance(texts, Texts):
        faults.append("it needs `texts`, a Texts that says " + ", ".join(f.name for f in fields(Texts)))
    else:
        empty = [f.name for f in fields(texts) if len(str(getattr(texts, f.name)).strip()) < FEWEST_LETTERS]
        if empty:
            faults.append(f"its texts say nothing under {', '.join(empty)}")
    try:
        inspect.signature(kind).bind()
    except TypeError:
        faults.append("it must be made without arguments: instances carry no state")
    return faults


def tried(source: ErrorSource, machine: Machine) -> list[str]:
    """Return faults of a source's parameters, effect and derivative; may be empty.

    Args:
        machine: for the test on a circle about mid-travel.

    Raises:
        Exception: raised by the source's code.
    """
    try:
        parameters = source.parameters(machine)
    except ModelError:
        return []  # This machine lacks an input; machines of the source's users have it.
    faults = _of_parameters(parameters)
    if faults:
        return faults
    motion = _circle(machine)
    values = np.array([p.grid[len(p.grid) // 2] if p.grid else p.plausible for p in parameters])
    # The derivative is tested first, because a linear source computes its effect from it.
    for what, ask, last in (("derivative", source.derivative, (len(parameters),)), ("effect", source.effect, ())):
        answer: object = ask(motion, machine, values)
        if not isinstance(answer, Effect):
            return [f"its {what} must return an Effect, not {type(answer).__name__}"]
        faults = _of_shapes(what, answer, len(motion), last)
        if faults:
            return faults
    signs = np.array([1.0 if p.grid else -OTHER_SIZE for p in parameters])
    return (
        _of_derivative(source, motion, machine, parameters, values)
        or _of_derivative(source, motion, machine, parameters, signs * values)
        or _of_proportion(source, motion, machine, parameters, values)
        or _of_needs(source, motion)
        or _of_history(source, motion, machine, values)
        or _of_other_laws(source, parameters, machine)
    )


def _of_history(source: ErrorSource, motion: Motion, machine: Machine, values: Floats) -> list[str]:
    if source.looks_ahead or not source.has_history:
        return []
    motion = replace(motion, straight=True)
    whole, half = source.effect(motion, machine, values), len(motion) // 2
    first, rest = motion.stretch(slice(0, half)), motion.stretch(slice(half, None))
    begun, state = source.advance(first, machine, values, source.begin(motion, machine, values))
    gone_on, _ = source.advance(rest, machine, values, state)
    for name, axes in EFFECT_SHAPES.items():
        expected = getattr(whole, name)
        if expected is None or np.ndim(expected) == len(axes):
            continue
        found = np.concatenate([getattr(begun, name), getattr(gone_on, name)])
        if np.abs(found - expected).max() > SAME * np.abs(expected).max():
            if type(source).advance is ErrorSource.advance:
                what = f"{name} of its effect hangs on rows that follow: write it from the rows so far, or set"
                return [f"{what} `looks_ahead = True`, with which it is fitted and predicted but not compensated"]
            return [f"{name} of its `advance` along two stretches is not its effect along both together"]
    return []


def _of_other_laws(source: ErrorSource, parameters: Sequence[Parameter], machine: Machine) -> list[str]:
    form = source.by_temperature()
    if form is not None:
        if (form.name, form.belongs_to) != (source.name, source.belongs_to) or form.varies_with == source.varies_with:
            return [
                "its form by temperature must have the same name and owner, and say that it varies with temperature"
            ]
        shared = {p.name for p in parameters} & {p.name for p in form.parameters(machine)}
        if shared:
            return [f"its form by temperature must have parameters of other names: {', '.join(sorted(shared))}"]
    laws = [source, *source.other_laws()]
    owners = {(law.name, law.belongs_to) for law in laws}
    named, given = {law.law for law in laws}, {frozenset(p.name for p in law.parameters(machine)) for law in laws}
    if len(owners) > 1 or min(len(named), len(given)) < len(laws):
        return ["its other laws must have the same name and owner, and each a `law` and parameters of its own"]
    faults = [(law, fault) for law in laws[1:] for fault in tried(law, machine)]
    return [
        f"in its form by temperature, {fault}" if law.varies_with == "temperature" else f"in its law {law.law}, {fault}"
        for law, fault in faults
    ]


def _of_parameters(parameters: Sequence[Parameter]) -> list[str]:
    if not isinstance(parameters, tuple) or not parameters or not all(isinstance(p, Parameter) for p in parameters):
        return ["its parameters must be a tuple of Parameter, one at least"]
    faults = []
    names = [p.name for p in parameters]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        faults.append(f"two of its parameters are called {', '.join(twice)}")
    faults += [
        f"its parameter {p.name} needs a plausible size above zero"
        for p in parameters
        if not (np.isfinite(p.plausible) and p.plausible > 0.0)
    ]
    for p in parameters:
        if not p.unit or len(p.meaning.split()) < FEWEST_WORDS:
            faults.append(f"its parameter {p.name} says no unit or meaning")
        elif not p.name.endswith(f"_{_as_in_names(p.unit)}"):
            faults.append(f"its parameter {p.name} must end with its unit, _{_as_in_names(p.unit)}")
        strut = re.match(r"(?:strut|joint)_([1-6])_", p.name)
        if p.strut != (int(strut[1]) if strut else None):
            faults.append(f"its parameter {p.name} must say with `strut` which strut it is of, as its name does")
        if p.grid and not min(p.grid) <= p.plausible <= max(p.grid):
            faults.append(f"the plausible size of its parameter {p.name} lies outside of its grid")
    return faults


def _as_in_names(unit: str) -> str:
    return re.sub(r"[/ ]", "_", re.sub(r"[()]", "", unit.lower().replace("µ", "u")))


def _of_proportion(
    source: ErrorSource,
    motion: Motion,
    machine: Machine,
    parameters: Sequence[Parameter],
    values: Floats,
) -> list[str]:
    zero = np.zeros(len(parameters))
    nothing = source.effect(motion, machine, zero)
    slopes = source.derivative(motion, machine, zero)
    faults = []
    doubled = values * np.where([bool(p.grid) for p in parameters], 1.0, 2.0)
    once, twice = (source.effect(motion, machine, each) for each in (values, doubled))
    for name in EFFECT_SHAPES:
        at_zero, whole, double = (getattr(effect, name) for effect in (nothing, once, twice))
        if (at_zero is None) is not (getattr(slopes, name) is None):
            faults.append(f"{name} stands in only one of its effect and its derivative where all parameters are zero")
        if at_zero is not None and np.abs(at_zero).max(initial=0.0) > SAME:
            faults.append(f"{name} of its effect is not zero where all its parameters are")
        if whole is None or double is None or source.has_history:
            continue
        if np.abs(double - 2.0 * whole).max(initial=0.0) > SAME * np.abs(whole).max(initial=0.0):
            faults.append(f"{name} of its effect is not proportional to its amplitudes: what is not must have a `grid`")
    return faults


def _of_needs(source: ErrorSource, motion: Motion) -> list[str]:
    without = {
        Need.PATH: {"is_path": False},
        Need.TIME: {"time_s": None},
        Need.TEMPERATURE: {"logged": {}},
        Need.CURRENT: {"logged": {}},
        Need.READING: {"reading_mm": None},
    }
    faults = []
    for need in sorted(source.needs - {Need.POSE}):
        try:
            source.require(replace(motion, **without[need]))  # type: ignore[arg-type]
        except ModelError:
            continue
        faults.append(f"its `require` takes a motion without {need}, which it needs")
    return faults


def _circle(machine: Machine) -> Motion:
    theta = np.linspace(0.0, 2.0 * np.pi, 181)
    centre = middle(machine).position_mm[0]
    poses = np.zeros((len(theta), 6))
    poses[:, :3] = centre + 60.0 * np.column_stack([np.cos(theta), np.sin(theta), np.zeros(len(theta))])
    poses[:, 3:] = [3.0, -2.0, 0.5]
    time_s = np.linspace(0.0, 30.0, len(theta)) + 600.0
    warming = 20.0 + 2.0 * (1.0 - np.exp(-time_s / 1800.0))
    logged = ("bar", "jig", "machine", *(f"strut{i + 1}" for i in range(STRUTS)))
    return Motion(
        poses,
        is_path=True,
        time_s=time_s,
        logged={**temperatures(dict.fromkeys(logged, warming)), **currents(np.ones((len(theta), STRUTS)))},
        setup=Setup("session", "mounting", "ball", "bar", centre, 1e-3, 1e-3, 5e-4),
        reading_mm=np.full(len(theta), 60.0) + 0.01 * np.sin(theta),
    )


def _of_shapes(what: str, answer: Effect, samples: int, last: tuple[int, ...]) -> list[str]:
    faults = []
    for name, axes in EFFECT_SHAPES.items():
        array = getattr(answer, name)
        if array is None:
            continue
        right = ((*axes, *last), (samples, *axes, *last))
        if np.shape(array) not in right:
            meant = " or ".join(str(shape) for shape in right)
            faults.append(f"{name} of its {what} has the shape {np.shape(array)}, not {meant}")
        elif not np.isfinite(array).all():
            faults.append(f"{name} of its {what} is not a number somewhere")
    return faults


def _of_derivative(
    source: ErrorSource,
    motion: Motion,
    machine: Machine,
    parameters: Sequence[Parameter],
    values: Floats,
) -> list[str]:
    derivative = source.derivative(motion, machine, values)
    faults = []
    for k, parameter in enumerate(parameters):
        step = np.zeros(len(parameters))
        step[k] = STEP * parameter.plausible
        more, less = (source.effect(motion, machine, values + sign * step) for sign in (1.0, -1.0))
        for name in EFFECT_SHAPES:
            ends, exact = (getattr(more, name), getattr(less, name)), getattr(derivative, name)
            if (ends[0] is None or ends[1] is None) is not (exact is None):
                faults.append(f"{name} stands in only one of its effect and its derivative")
            elif exact is not None:
                slope = (ends[0] - ends[1]) / (2.0 * step[k])
                scale = max(float(np.abs(exact[..., k]).max()), float(np.abs(slope).max()))
                # The difference of nearly equal effects is mostly rounding.
                rounding = ROUNDED * float(max(np.abs(end).max() for end in ends)) / step[k]
                off = np.abs(slope - exact[..., k]) > AGREES * scale + rounding
                if off.mean() > MOST_KINKS:
                    faults.append(f"its derivative of {name} by {parameter.name} is not what its effect does")
    return list(dict.fromkeys(faults))
