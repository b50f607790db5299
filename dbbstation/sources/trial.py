"""Whether a class that somebody wrote keeps the contract of an error source: what it declares, and a run to try it on.

Sources of the package are held to the contract by tests. One that comes from elsewhere is looked at before it is used,
so that a shape or a sign that does not fit is said of the source and not found later in a fit.
"""

from __future__ import annotations

import inspect
import re
from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import STRUTS
from dbbstation.machine.travel import middle
from dbbstation.sources.contract import EFFECT_SHAPES, Effect, ErrorSource, Motion, Need, Owner, Parameter, Setup, Texts
from dbbstation.trace.columns import currents, temperatures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine

NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")

STEP = 1e-4
"""Share of a plausible size by which a derivative is checked."""

AGREES = 1e-2
"""Share of its greatest value by which a derivative may differ from what the effect does."""

SAME = 1e-9
"""Share of the greatest effect by which two stretches may differ from the whole: rounding."""

MOST_KINKS = 0.05
"""Share of samples where it may differ more: play has kinks, where no derivative holds."""


def undeclared(kind: type[ErrorSource]) -> list[str]:
    """Say what a class lacks of the contract before it can be made; empty where nothing is."""
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
    texts = getattr(kind, "texts", None)
    if not isinstance(texts, Texts):
        faults.append("it needs `texts`, a Texts that says " + ", ".join(f.name for f in fields(Texts)))
    else:
        empty = [f.name for f in fields(texts) if not str(getattr(texts, f.name)).strip()]
        if empty:
            faults.append(f"its texts say nothing under {', '.join(empty)}")
    try:
        inspect.signature(kind).bind()
    except TypeError:
        faults.append("it must be made without arguments: instances carry no state")
    return faults


def tried(source: ErrorSource, machine: Machine) -> list[str]:
    """Say what is wrong with a source's parameters, effect and derivative; empty where nothing is.

    Args:
        source: made from a class that lacks nothing.
        machine: to try it on, a circle about the middle of its travel.

    Raises:
        Exception: whatever the source's own code raises.
    """
    try:
        parameters = source.parameters(machine)
    except ModelError:
        return []  # This machine lacks what it needs; its own users have it.
    faults = _of_parameters(parameters)
    if faults:
        return faults
    motion = _circle(machine)
    values = np.array([p.shape[len(p.shape) // 2] if p.shape else p.plausible for p in parameters])
    # A derivative comes first: where only that is written, the effect is made of it.
    for what, ask, last in (("derivative", source.derivative, (len(parameters),)), ("effect", source.effect, ())):
        answer: object = ask(motion, machine, values)
        if not isinstance(answer, Effect):
            return [f"its {what} must return an Effect, not {type(answer).__name__}"]
        faults = _of_shapes(what, answer, len(motion), last)
        if faults:
            return faults
    return (
        _of_derivative(source, motion, machine, parameters, values)
        or _of_history(source, motion, machine, values)
        or _of_second_form(source, parameters, machine)
    )


def _of_history(source: ErrorSource, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> list[str]:
    """Whether a program in two stretches has the effect of the whole, as a compensation needs it that goes forward."""
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


def _of_second_form(source: ErrorSource, parameters: Sequence[Parameter], machine: Machine) -> list[str]:
    """The form by temperature, where there is one: model files and diagnoses tell the two apart."""
    form = source.by_temperature()
    if form is None:
        return []
    if (form.name, form.belongs_to) != (source.name, source.belongs_to) or form.varies_with == source.varies_with:
        return ["its form by temperature must have the same name and owner, and say that it varies with temperature"]
    shared = {p.name for p in parameters} & {p.name for p in form.parameters(machine)}
    if shared:
        return [f"its form by temperature must have parameters of other names: {', '.join(sorted(shared))}"]
    return [f"in its form by temperature, {fault}" for fault in tried(form, machine)]


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
    return faults + [
        f"its parameter {p.name} says no unit or meaning" for p in parameters if not (p.unit and p.meaning)
    ]


def _circle(machine: Machine) -> Motion:
    """One turn about the middle of the travel with everything that a source may ask for."""
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
    values: NDArray[np.float64],
) -> list[str]:
    """Compare the derivative with what the effect does over a small step to both sides."""
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
                off = np.abs(slope - exact[..., k]) > AGREES * scale
                if off.mean() > MOST_KINKS:
                    faults.append(f"its derivative of {name} by {parameter.name} is not what its effect does")
    return list(dict.fromkeys(faults))
