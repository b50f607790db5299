"""Values of a finding's parameters, with names, units and uncertainties."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.facts.value import Value
from dbbstation.inference.bank import amplitudes_of
from dbbstation.inference.forms import HARMONICS
from dbbstation.inference.jackknife import weighted_jackknife
from dbbstation.inference.model_comparison import amplitude_size
from dbbstation.inference.patterns import ZEROS, covers_turns, zeros_text
from dbbstation.inference.triangle import root
from dbbstation.inference.uneven import widening_of
from dbbstation.inference.variables import Kind

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.channel import Law
    from dbbstation.inference.model_comparison import Member
    from dbbstation.inference.settled import Settled


def named_values(settled: Settled, member: Member, values: Floats, covariance: Floats) -> dict[str, Value]:
    """Return amplitudes and nonlinear parameters; uncertainties include slack."""
    law, covariance = settled.bank.laws.get(member.name), widening_of(settled.bank.tails) * covariance
    if law is not None:
        found = values_of_law(law, member, values, covariance, law.form_uncertainty)
        if any(
            v.kind is Kind.TIME
            for name in settled.best.names & set(settled.bank.patterns)
            for v in settled.bank.patterns[name].variables
        ):
            found.pop("zero", None)  # part of it is in the drift
        return found
    sigma, width = np.sqrt(np.maximum(np.diag(covariance), 0.0)), member.width
    pattern = settled.bank.patterns[member.name]
    unit = settled.channel.unit
    if len(pattern.per) < width:
        return {}
    names = _NAMES.get(str(pattern.family), tuple(f"amplitude {k + 1}" for k in range(width)))[:width]
    return {
        name: Value(float(values[k] / pattern.per[k]), float(sigma[k] / pattern.per[k]), _unit(unit, pattern.units[k]))
        for k, name in enumerate(names)
    }


def values_of_law(law: Law, member: Member, values: Floats, covariance: Floats, share: float) -> dict[str, Value]:
    """Return a law's amplitudes and nonlinear parameters; `share` is the least relative uncertainty of amplitudes, and without tangent a parameter's uncertainty is NaN."""
    sigma, width, every = np.sqrt(np.diag(covariance).clip(0.0)), member.width, len(law.plausible)
    found = {
        law.parameters[j]: Value(float(values[k]), float(np.hypot(sigma[k], share * values[k])), law.units[j])
        for k, j in enumerate(amplitudes_of(member.variant).tolist())
    }
    per = growth(member, values)
    shaped = moved(law, member, values, per)
    for k, name in enumerate(law.parameters[every:]):
        known = len(member.variant.slack) > k
        found[name] = Value(shaped[k], float(sigma[width + k] / per) if known else np.nan, law.units[every + k])
    if law.zero_from is not None and values[0]:
        moved_by = float(values[1] / values[0])
        slopes = np.array([moved_by, -1.0]) / values[0]
        u = root(slopes @ covariance[:2, :2] @ slopes)
        found["zero"] = Value(law.zero_from - moved_by, u, law.variables[0].unit)
    return found


def moved(law: Law, member: Member, values: Floats, per: float = 1.0) -> tuple[float, ...]:
    """Return nonlinear parameters corrected by their tangents, within grids.

    Args:
        per: `growth` for tangents of another form.
    """
    nonlinear = list(member.variant.nonlinear)
    if len(member.variant.slack):
        for k, grid in enumerate(law.grids):
            by = values[member.width + k] / per
            nonlinear[k] = float(np.clip(nonlinear[k] + by, grid[0], grid[-1]))
    return tuple(nonlinear)


def growth(member: Member, values: Floats) -> float:
    """Return the ratio of a member's amplitudes to the amplitudes of its tangents."""
    if not len(member.variant.slack):
        return 1.0
    size = amplitude_size(member, values[: member.width])
    return size / member.variant.slack_at if size > 0.0 else 1.0


def label_of(settled: Settled, member: Member, values: Floats) -> str:
    """Return the variant's label, for a product with its fitted zeros."""
    pattern, width = settled.bank.patterns.get(member.cause.name), len(member.variant.columns)
    if pattern is None or not pattern.slack:
        return member.variant.label
    label = [text for _, _, text in pattern.choices].index(member.variant.label)
    lines = [v for v in pattern.variables if not covers_turns(v)]
    begun = list(product(ZEROS, repeat=len(lines)))[label]
    own, moving = values[:width], values[width:].reshape(-1, width)[::-1]
    zeros = begun - moving @ own / max(float(own @ own), 1e-300)
    return f"about {zeros_text(lines, zeros.tolist())}"


def values_of_members(settled: Settled, members: Sequence[Member]) -> dict[str, dict[str, Value]]:
    """Return values of members that are fitted together, by name."""
    return {one[0].name: named_values(settled, *one) for one in settled.comparison.estimated(members)}


def with_jackknife(
    found: Mapping[str, Value], without: Sequence[Mapping[str, Value]], most: float = np.inf
) -> dict[str, Value]:
    """Return values with the larger of stated and jackknife uncertainty.

    Args:
        without: values without one part each; some may lack a value.
        most: largest weight of a part. For k selections without one part each, in which noise and other effects change,
            it is 1 - 1 / k [Mosteller and Tukey, Data Analysis and Regression, 1977, ch. 8].
    """
    every = {}
    for name, value in found.items():
        parts = np.array([(part[name].value, part[name].uncertainty) for part in without if name in part]).reshape(
            -1, 2
        )
        own, there = np.square(value.uncertainty), max(len(parts), 1)
        variances = np.maximum(np.square(parts[:, 1]), own / most)
        u = weighted_jackknife(np.array(value.value), np.array(own), parts[:, 0], variances)
        every[name] = value.at_least(float(u * np.sqrt(len(without) / there)))
    return every


_NAMES = {
    "linear": ("slope",),
    "drift": ("slope",),
    "once per turn": ("cosine", "sine"),
    "twice per turn": ("cosine", "sine"),
    "wave": ("cosine", "sine", *(f"{name} {k}" for k in range(2, max(HARMONICS) + 1) for name in ("cosine", "sine"))),
    "hysteresis": ("half width",),
    "speed": ("per speed",),
    "drag": ("coefficient",),
    "lag": ("delay",),
    "product": ("coefficient",),
    "bump": ("height",),
    "step": ("height",),
}


def _unit(unit: str, per: str) -> str:
    return f"{unit}{per}" if per == "" or per.startswith(("/", " per")) else per
