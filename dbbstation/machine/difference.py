"""Differences of two machine files, by their keys."""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import STRUTS, Hexapod
from dbbstation.text.written import listed

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dbbstation.machine.geometry import Machine

DESCRIPTION = frozenset({"name", "control"})
"""Keys that do not describe the nominal machine; a control's correction counts as part of the commands."""

NOT_PREDICTED = frozenset({"travel", "joint_tolerance_mm", "acceleration_mm_s2"})
"""Keys that no prediction of a calibrated model uses: limits of motion, and prior standard deviations of a fit."""

CONTROL = frozenset({"base_joints_mm", "platform_joints_mm", "rotation", "reference_length_error_mm"})
"""Keys that every prediction uses, because the control computes strut lengths from them."""

NOT_GIVEN = "not given"

ROUNDED_MM = 1e-6
"""Smaller differences of joints and lengths are rounding: a nanometre, which no test resolves [mm]."""


@dataclass(frozen=True)
class Difference:
    """One differing value."""

    key: str
    one: str
    other: str

    @property
    def text(self) -> str:
        """Return key and both values."""
        return f"{self.key} {self.one} and {self.other}"

    @property
    def first_key(self) -> str:
        """Return the top-level key of the machine file."""
        return self.key.partition(".")[0].partition(" ")[0]


def differences(one: Machine, other: Machine) -> tuple[Difference, ...]:
    """Return every difference beyond a nanometre, except names."""
    return tuple(found for found in _between("", one, other) if found.first_key not in DESCRIPTION)


def in_words(found: Sequence[Difference], most: int = 4) -> str:
    """Return the first differences in words, with the count of others."""
    return listed([difference.text for difference in found], most, between="; ")


def check_model_is_of(machine: Machine, calibrated: Machine) -> None:
    """Refuse a model of another machine.

    Raises:
        ModelError: names differences with both values.
    """
    found = [
        difference
        for difference in differences(calibrated, machine)
        if difference.first_key not in NOT_PREDICTED
        and (difference.first_key in CONTROL or NOT_GIVEN not in {difference.one, difference.other})
    ]
    if found:
        what = f"the model was calibrated on another nominal machine ({calibrated.name}) than {machine.name}"
        raise ModelError(
            f"{what}: {in_words(found)}",
            remedy="use the model of this machine, or the machine file that the model's sessions were recorded with",
        )


def _between(key: str, one: object, other: object) -> Iterator[Difference]:
    if is_dataclass(one) and type(one) is type(other):
        for field in fields(one):
            # The machine file has the joints at its top.
            inner = "" if isinstance(getattr(one, field.name), Hexapod) else field.name
            yield from _between(
                ".".join(filter(None, (key, inner))), getattr(one, field.name), getattr(other, field.name)
            )
    elif isinstance(one, np.ndarray) and isinstance(other, np.ndarray) and len(one) == len(other) == STRUTS:
        for strut, (a, b) in enumerate(zip(one, other, strict=True), start=1):
            if not np.allclose(a, b, rtol=0.0, atol=ROUNDED_MM):
                yield Difference(f"{key} of strut {strut}", _said(a.tolist()), _said(b.tolist()))
    elif one != other:
        yield Difference(key, _said(one), _said(other))


def _said(value: object) -> str:
    if value is None:
        return NOT_GIVEN
    if isinstance(value, tuple):
        return str(list(value))
    if is_dataclass(value):
        inside = "; ".join(f"{field.name} {_said(getattr(value, field.name))}" for field in fields(value))
        return f"({inside})"
    if isinstance(value, np.ndarray):
        return str(value.tolist())
    return str(value)
