"""What the tests say without some of them: predictions of left-out tests, and what is found again in the others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.checks.noise_level import fine_noise_mm
from dbbstation.calibration.fit.calibrate import SMALLEST_NOISE_MM
from dbbstation.inference.harmonics import LOW
from dbbstation.inference.held_out import HeldOut, held_out
from dbbstation.inference.selection_frequency import renumbered, selection_frequency

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.diagnosis.explain import Explained
    from dbbstation.model.observation import Observation

FOLDS = 5
"""Groups of tests that are left out in turn."""


def predicted(explained: Explained) -> tuple[HeldOut, HeldOut]:
    """Predictions of left-out tests without and with the named causes [mm]."""
    channel, settled = explained.channel, explained.settled
    noise_mm = max(settled.noise_mm, SMALLEST_NOISE_MM)
    single = max(_single_noise_mm(channel.observations, noise_mm, fine_noise_mm(settled.after)), SMALLEST_NOISE_MM)
    tests = tests_of(channel.observations)
    groups = [test % min(FOLDS, max(tests) + 1) for test in tests]
    variants = [member.variant for member in settled.members]
    known = channel.known_with(variants)
    blocks = channel.blocks(channel.columns_of(variants), channel.target(settled.after))
    every = np.arange(len(known.prior))
    without, having = (
        held_out(blocks, groups, known, active, noise_mm, channel.held, single)
        for active in (every[: len(channel.base.prior)], every)
    )
    return without, having


def found_again(explained: Explained, names: Sequence[str]) -> dict[str, float]:
    """Share of draws of seven tenths of the tests in which causes are found again; nothing where none was found.

    Args:
        explained: what the comparison came to.
        names: of named causes that compete in each draw, beside everything that was found.
    """
    channel, settled = explained.channel, explained.settled
    if not settled.members:
        return {}
    wanted = {*names, *settled.best.names}
    columns, causes = renumbered([cause for cause in settled.causes if cause.name in wanted])
    return selection_frequency(
        channel.blocks(columns, channel.target(settled.after)),
        tests_of(channel.observations),
        channel.base,
        channel.held,
        causes,
        max(settled.noise_mm, SMALLEST_NOISE_MM),
        np.random.default_rng(len(channel.observations)),
    )


def tests_of(observations: Sequence[Observation]) -> list[int]:
    """Number of the test of each run, counted in the order of recording."""
    order = {name: k for k, name in enumerate(dict.fromkeys(o.test for o in observations))}
    return [order[o.test] for o in observations]


def _single_noise_mm(observations: Sequence[Observation], noise_mm: float, fine_mm: float) -> float:
    """Noise of a single sample, where the low harmonics, few of all, carry more of it than the fine ones [mm]."""
    samples = float(np.mean([len(o.raw) for o in observations]))
    low = min((2 * LOW + 1) / samples, 1.0)
    return float(np.sqrt(low * noise_mm**2 + (1.0 - low) * min(fine_mm, noise_mm) ** 2))
