"""Held-out tests: prediction errors, gains, and selection frequencies."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.checks.scatter import fine_noise_mm
from dbbstation.calibration.fit.calibrate import SMALLEST_NOISE_MM
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.chosen_anew import (
    columns_of,
    gains_of_tests,
    groups_of_tests,
    rows_of_groups,
    selection_frequency,
)
from dbbstation.inference.folds import FOLDS_OF_AN_ERROR, in_turn, numbered
from dbbstation.inference.harmonics import LOW
from dbbstation.inference.held_out import HeldOut, held_out
from dbbstation.inference.hypotheses import CLOSE
from dbbstation.inference.jackknife import widening
from dbbstation.inference.model_comparison import all_columns
from dbbstation.inference.square_root import solve

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.diagnosis.explained import Explained
    from dbbstation.inference.chosen_anew import KnownGains
    from dbbstation.inference.model_comparison import Member
    from dbbstation.inference.settled import Settled
    from dbbstation.inference.square_root import Solution
    from dbbstation.model.observation import Observation


def predicted(explained: Explained) -> tuple[HeldOut, HeldOut]:
    """Return prediction errors of held-out tests without and with named causes [mm]."""
    channel, settled = explained.channel, explained.settled
    noise_mm = max(settled.noise_mm, SMALLEST_NOISE_MM)
    single = max(_single_noise_mm(channel.observations, noise_mm, fine_noise_mm(settled.after)), SMALLEST_NOISE_MM)
    having = _held_out(explained, settled.members, single=single)
    return having(settled.members), having(())


def predicted_without(explained: Explained, left_out: Sequence[Collection[str]]) -> list[float]:
    """Return the rms error of held-out tests [mm] after omitting each set of causes; a displaced ball stays in its test."""
    members = [m for m in explained.settled.best.members if not m.cause.setup]
    having = _held_out(explained, members)
    return [having([m for m in members if m.name in names]).rms for names in left_out]


def _held_out(
    explained: Explained, members: Sequence[Member], single: float | None = None
) -> Callable[[Sequence[Member]], HeldOut]:
    """Return a function that predicts held-out tests with all members but some."""
    channel, settled, variants = explained.channel, explained.settled, [member.variant for member in members]
    known, base = channel.known_with(variants), len(channel.base.prior)
    blocks = channel.blocks(all_columns(variants), channel.target(settled.after))
    groups = in_turn([o.test for o in channel.observations], FOLDS_OF_AN_ERROR)

    def but_for(some: Sequence[Member]) -> HeldOut:
        out = np.concatenate([np.zeros(base, dtype=bool), *(np.full(m.width, m in some) for m in members)])
        noise_mm, kept = max(settled.noise_mm, SMALLEST_NOISE_MM), np.flatnonzero(~out)
        return held_out(blocks, groups, known, kept, base, noise_mm, channel.held, single)

    return but_for


def without_tests(explained: Explained, outcome: Settled) -> KnownGains | None:
    """Return gains of named causes and classes in groups of tests; None for few tests or without causes.

    The reference is the kinematic calibration of the same tests.
    """
    channel = explained.channel
    return gains_of_tests(
        outcome,
        rows_of_groups(groups_of_tests([o.test for o in channel.observations]), channel.runs),
        partial(predicted_without, explained),
        lambda cause: cause.named,
        most_members=BOUNDS.members,
        likely=CLOSE,
        thorough=False,
    )


def found_again(explained: Explained, outcome: Settled, names: Sequence[str]) -> dict[str, float]:
    """Return selection frequencies of causes in draws of seven tenths of tests; may be empty."""
    channel, settled = explained.channel, explained.settled
    if not settled.members:
        return {}
    causes = [cause for cause in settled.causes if cause.name in {*names, *settled.best.names}]
    lengths, used = [rows.stop - rows.start for rows in channel.runs], columns_of(causes)
    return selection_frequency(
        numbered([o.test for o in channel.observations]),
        causes,
        lambda out: outcome.bank.without(np.repeat(out, lengths), used),
        np.random.default_rng(len(channel.observations)),
        settled.best.members,
        BOUNDS.members,
    )


def widened_by_tests(calibration: Calibration) -> Calibration:
    """Return the fit with the larger of its uncertainties and jackknife uncertainties over tests.

    The selection, correlations [`widening`] and stated sizes of random effects do not change. With fewer than
    `LEAST_PARTS` groups the fit does not change.
    """
    groups = groups_of_tests([o.test for o in calibration.observations])
    if not groups:
        return calibration
    known, noise = calibration.layout.known, calibration.noise.effective
    held, behind = calibration.solution.held, calibration.blocks[len(groups) :]

    def without(group: int | None) -> Solution:
        circles = [block for block, own in zip(calibration.circle_blocks, groups, strict=True) if own != group]
        return solve([*circles, *behind], known, noise, held)

    of_all, others = without(None), [without(group) for group in np.unique(groups)]
    moved = np.array([other.x - of_all.x for other in others])
    variances = [solution.variance for solution in (of_all, *others)]
    factor = np.where(known.random, 1.0, widening(variances[0], moved, np.array(variances[1:])))
    spreads = calibration.solution.spreads.times(factor)
    return replace(calibration, solution=replace(calibration.solution, spreads=spreads))


def _single_noise_mm(observations: Sequence[Observation], noise_mm: float, fine_mm: float) -> float:
    """Return a single sample's noise if low harmonics have more noise than high ones [mm]."""
    samples = float(np.mean([len(o.raw) for o in observations]))
    low = min((2 * LOW + 1) / samples, 1.0)
    return float(np.sqrt(low * noise_mm**2 + (1.0 - low) * min(fine_mm, noise_mm) ** 2))
