"""Predict held-out tests of a comparison."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.blocks import compress
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.chosen_anew import KnownGains, gains_of_tests, groups_of_tests, rows_of_groups
from dbbstation.inference.folds import FOLDS_OF_AN_ERROR, in_turn
from dbbstation.inference.held_out import held_out
from dbbstation.inference.jackknife import refits_without
from dbbstation.inference.read_off import Trial

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from dbbstation.diagnosis.compare.sides import Sides
    from dbbstation.inference.held_out import HeldOut
    from dbbstation.inference.model_comparison import Member
    from dbbstation.inference.settled import Settled


def tried_without_tests(sides: Sides, settled: Settled, *, hold_out: bool = True) -> tuple[Trial, KnownGains | None]:
    """Predict groups of tests; empty without findings or with fewer than `LEAST_PARTS` groups."""

    def errors(without: Sequence[Collection[str]]) -> Sequence[float]:
        return [predicted(sides, settled, settled.best.without(*names)).rms for names in without]

    parts = rows_of_groups(groups_of_tests([pair.test for pair in sides.pairs]), sides.blocks)
    refits = refits_without(settled, parts) if settled.best.members else ()
    gains = gains_of_tests(settled, parts, errors, most_expanded=BOUNDS.expanded_of_table) if hold_out else None
    return Trial(None if gains is None else gains.anew, refits), gains


def predicted(sides: Sides, settled: Settled, members: Sequence[Member]) -> HeldOut:
    """Return prediction errors of held-out tests with stated set-ups and some causes."""
    bank, channel = settled.bank, settled.channel
    columns, known = bank.jointly(members)
    groups = in_turn([pair.test for pair in sides.pairs], FOLDS_OF_AN_ERROR)
    every = np.arange(len(known.prior))
    blocks = [compress(every, columns[rows], bank.target[rows]) for rows in sides.blocks]
    return held_out(blocks, groups, known, every, len(channel.base.prior), settled.noise.innovation, channel.held)
