"""Find significant features of the residual after base and members."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.channel import Kind, Variable
from dbbstation.inference.coloured import Fitting, Left, LeftBesideOthers
from dbbstation.inference.looks import PLACED, looked_for, placed_better
from dbbstation.inference.patterns import Family
from dbbstation.inference.square_root import free_directions
from dbbstation.inference.stretches import refined, stretches

if TYPE_CHECKING:
    from collections.abc import Container, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.bank import Bank
    from dbbstation.inference.channel import Channel
    from dbbstation.inference.model_comparison import Member
    from dbbstation.inference.patterns import Pattern

IN_TIME = (Family.PULSES, Family.PULSES_BY_DIRECTION)
"""Families whose edges are nonlinear parameters, optimised for each noise."""

MOVED = (*IN_TIME, *PLACED)
"""Families whose places, edges, widths or frequencies are optimised."""


def seen(bank: Bank, members: Sequence[Member], *, in_time: bool) -> list[Pattern]:
    """Return significant patterns of the residual."""
    channel = bank.channel
    left = _left(bank, *_fitted(bank, members))
    size = channel.size / left.noise
    found = looked_for(left, channel.variables, channel.kept, size)
    if in_time and channel.time is not None:
        found += _in_time(left, channel, size)
    return bank.worthy(left, found)


def _fitted(bank: Bank, members: Sequence[Member]) -> tuple[Floats, Floats]:
    known, held = bank.channel.known, bank.channel.held
    fixed, random = np.flatnonzero(~known.random), np.flatnonzero(known.random)
    base = bank.base
    columns = [base[:, fixed] @ free_directions(known, fixed, held), base[:, random]]
    sd = [np.full(columns[0].shape[1], np.inf), known.prior[random]]
    for member in members:
        columns.append(bank.fitted(member.columns))
        sd.append(member.sd)
    return np.hstack(columns), np.concatenate(sd)


def _left(bank: Bank, columns: Floats, sd: Floats) -> Left:
    return Fitting.of(columns, sd, bank.noise, bank.whitening).left(bank.target)


def places_anew(bank: Bank, members: Sequence[Member], among: Container[str]) -> tuple[Member, ...]:
    """Return members with places optimised for the present noise."""
    channel = bank.channel
    members = list(members)
    for number, member in enumerate(members):
        pattern = bank.patterns.get(member.name)
        if pattern is None or pattern.family not in MOVED or pattern.name not in among:
            continue
        others, sd = _fitted(bank, [*members[:number], *members[number + 1 :]])
        count = member.width
        size = channel.size / bank.noise.innovation
        if pattern.family in PLACED:
            better = placed_better(pattern, _left(bank, others, sd), channel.kept, size)
        else:
            better = refined(
                pattern,
                count,
                LeftBesideOthers(
                    Fitting.of(others, sd, bank.noise, bank.whitening), member.sd[:count], bank.target, bank.whitened
                ),
                channel.blocks,
                channel.kept,
                size,
                clock=channel.clock,
                direction=channel.direction if pattern.family is Family.PULSES_BY_DIRECTION else None,
            )
        if better.name == pattern.name or better.name in bank.patterns:
            continue
        bank.drop({pattern.name})
        bank.add([better])
        cause = next(cause for cause in bank.causes if cause.name == better.name)
        members[number] = replace(member, cause=cause, variant=cause.widest)
    return tuple(members)


def _in_time(left: Left, channel: Channel, size: float) -> list[Pattern]:
    by = None
    if channel.time is not None and channel.direction is not None:
        by = (Variable("time", channel.time_unit, Kind.TIME, channel.time), channel.direction)
    return stretches(left, channel.blocks, channel.kept, size, clock=channel.clock, by=by)
