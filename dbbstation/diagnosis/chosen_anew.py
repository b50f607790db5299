"""Each named cause's gain in held-back groups of tests, and each class's."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.fit.calibrate import SMALLEST_NOISE_MM
from dbbstation.diagnosis.left_out import groups_of, predicted_without
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.chosen_anew import KnownGains, gains_of_tests, rows_of_groups
from dbbstation.inference.hypotheses import CLOSE, search

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dbbstation.diagnosis.explained import Explained
    from dbbstation.inference.model_comparison import Member, ModelComparison
    from dbbstation.inference.settled import Settled


def without_tests(explained: Explained, outcome: Settled) -> KnownGains | None:
    """Hold back groups of tests; None for too few, or without causes.

    The reference is the kinematic calibration of the same tests.
    """
    settled, channel = explained.settled, explained.channel
    groups = groups_of(channel.observations)
    if not settled.best.members or groups is None:
        return None
    held_back = rows_of_groups(groups, channel.runs)
    target = settled.target
    noise_mm = max(settled.noise_mm, SMALLEST_NOISE_MM)
    # What was laid out before it was laid out better is asked for by nobody.
    variants = [variant for cause in settled.causes for variant in cause.variants]
    used = np.unique(np.concatenate([columns for one in variants for columns in (one.columns, one.slack)]))

    def of_others() -> Iterator[ModelComparison]:
        for out in held_back:
            kept = np.where(out, 0.0, target)
            yield channel.beside_base(noise_mm, settled.scatter, but_for=out, only=used).comparison(kept)

    def choose(comparison: ModelComparison) -> Sequence[Member]:
        begin = [settled.best.members]
        found = search(comparison, settled.causes, begin, most_members=BOUNDS.members, likely=CLOSE, thorough=False)
        return found.best.members

    comparisons = settled.comparison, of_others()
    errors = partial(predicted_without, explained)
    return gains_of_tests(outcome, held_back, comparisons, choose, errors, lambda cause: cause.named)
