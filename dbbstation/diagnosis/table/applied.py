"""Apply a correction to other rows with the same columns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.threads import with_one_thread
from dbbstation.diagnosis.table.mismatch import fitted_together
from dbbstation.errors import CalibrationError
from dbbstation.inference.bank import amplitudes_of, spacing_of, tangents_of
from dbbstation.inference.coloured import widening_of
from dbbstation.inference.folds import parts_of, refits_without, weighted_jackknife
from dbbstation.inference.followed import followed_by
from dbbstation.inference.levels import ONCE
from dbbstation.inference.model_comparison import slices_of
from dbbstation.inference.patterns import Family
from dbbstation.inference.read_off import growth, moved
from dbbstation.inference.settle import static_patterns

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.table.data import Table
    from dbbstation.diagnosis.table.mismatch import Mismatch
    from dbbstation.inference.channel import Channel
    from dbbstation.inference.model_comparison import Member
    from dbbstation.inference.patterns import Pattern
    from dbbstation.laws.contract import TableSource


@dataclass(frozen=True, eq=False)
class AppliedCorrection:
    """The correction of simulated values in other rows.

    Attributes:
        values: shape (n,).
        uncertainty: standard uncertainty of the correction, without a row's noise, shape (n,).
        left_out: effects that do not apply to other rows, such as a drift.
        beyond: rows outside the fitted range by variable.
    """

    values: Floats
    uncertainty: Floats
    left_out: tuple[str, ...]
    beyond: dict[str, int]


@with_one_thread
def applied(found: Mismatch, other: Table, sources: Sequence[TableSource] = ()) -> AppliedCorrection:
    """Return the correction of other rows, in a table `like` the fitted one.

    The correction adds the constant, refitted parameters and effects over its variables. It omits effects over time or
    runs, and memory of earlier rows.

    Raises:
        CalibrationError: these rows lack an effect's direction or rate.
    """
    settled, channel = found.settled, other.channel(sources)
    bank, corrects = settled.bank, found.levels.corrects
    fitted = fitted_together(settled)
    columns = [channel.base.samples]
    values, over, left_out = np.zeros(len(other)), set[str](), list[str]()
    members = settled.best.members
    for member, own in zip(members, slices_of(members, channel.base.samples.shape[1]), strict=True):
        follows = followed_by(bank, member.name)
        if follows <= ONCE or (corrects and not follows & corrects):
            left_out.append(member.name)
            columns.append(np.zeros((len(other), len(member.columns))))
            continue
        over |= follows
        effect, slopes = _effect(found, channel, member, fitted.x[own])
        values += effect
        columns.append(slopes)
    every = np.hstack(columns)
    base = channel.base.samples @ fitted.x[: channel.base.samples.shape[1]]
    refits = refits_without(settled, [rows for _, rows in parts_of(settled.channel)])
    wider = widening_of(bank.tails)
    variances = wider * _variances(every, fitted.covariance)
    u = weighted_jackknife(
        np.zeros(len(other)),
        variances,
        np.array([every @ (one.x - fitted.x) for one in refits]),
        wider * np.array([_variances(every, one.covariance) for one in refits]),
    )
    beyond = {
        v.name: int(np.sum((v.values < v.low) | (v.values > v.high))) for v in channel.variables if v.name in over
    }
    return AppliedCorrection(
        base + values,
        np.maximum(u, np.sqrt(variances)),
        tuple(left_out),
        {name: count for name, count in beyond.items() if count},
    )


def _variances(rows: Floats, covariance: Floats) -> Floats:
    return np.maximum(np.sum(rows @ covariance * rows, axis=1), 0.0)


FORMED = frozenset({Family.LINEAR, Family.ONCE, Family.TWICE, Family.CURVE, Family.WAVE, Family.BUMP, Family.STEP})
"""Families that depend only on one variable's value."""


def _effect(found: Mismatch, channel: Channel, member: Member, values: Floats) -> tuple[Floats, Floats]:
    """Return a member's effect in other rows, shape (n,), and its slopes by amplitudes and slack, shape (n, p)."""
    name, bank, width = member.name, found.settled.bank, member.width
    slopes = np.zeros((len(channel.residual), len(values)))
    if name not in bank.laws:
        slopes[:] = _samples(bank.patterns[name], channel, member.variant.label)
        return slopes @ values, slopes
    law = next((one for one in channel.laws if one.name == name), None)
    if law is None:
        raise _unknown(name)
    fitted, used = bank.laws[name], amplitudes_of(member.variant)
    own = np.array([k for k in range(width) if not fitted.parameters[used[k]].startswith("start ")], dtype=np.int64)
    per = growth(member, values)
    point = moved(fitted, member, values, per)
    exact = law.columns(point)
    slopes[:, own] = exact[:, used[own]]
    effect = slopes[:, :width] @ values[:width]
    amplitudes = np.zeros(exact.shape[1])
    amplitudes[used[own]] = values[own]
    spacings = [spacing_of(grid, value) for grid, value in zip(fitted.grids, point, strict=True)]
    for k, slope in enumerate(tangents_of(law, point, amplitudes, spacings if len(member.variant.slack) else ())):
        slopes[:, width + k] = slope / per
    return effect, slopes


def _samples(pattern: Pattern, channel: Channel, label: str) -> Floats:
    if pattern.family in FORMED and pattern.form is not None:
        (variable,) = (v for v in channel.variables if v.name == pattern.variables[0].name)
        return pattern.form.columns(variable.values)
    same = next((one for one in static_patterns(channel) if one.name == pattern.name), None)
    if same is None:
        raise _unknown(pattern.name)
    part = next((part for part, _, one in pattern.choices if one == label), None)
    return same.samples if part is None else same.samples[:, [*part, *same.slack]]


def _unknown(name: str) -> CalibrationError:
    what = f"`{name}` is part of the correction, and these rows do not say it"
    return CalibrationError(what, remedy="give rows in the order of measuring, at least as close as the others")
