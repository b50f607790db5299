"""Samples that were lost: counted from their times, refused beyond the plan's limit, suspected before the feed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import TraceError
from dbbstation.trace.cut import cut, lost_on_turn
from dbbstation.trace.recording import Recording, lost_samples, too_many_lost
from tests.trace.test_cut import CIRCLE, trace

PERIOD_S = 0.004


@pytest.mark.parametrize("lost", [1, 456, 3194])
def test_what_was_taken_out_of_a_stream_is_counted(lost: int) -> None:
    rng = np.random.default_rng(lost)
    t_s = np.arange(18832) * PERIOD_S + rng.normal(0.0, 1e-4, 18832)
    inside = np.arange(1, 18831)
    bursts = np.unique(np.concatenate([[9000], rng.choice(inside, lost, replace=False)]))[:lost]
    assert lost_samples(np.delete(t_s, bursts)) == lost


def test_a_burst_is_counted_whole() -> None:
    t_s = np.arange(18832) * PERIOD_S
    assert lost_samples(np.delete(t_s, slice(5000, 8194))) == 3194


def test_a_stream_without_a_gap_lost_nothing() -> None:
    assert lost_samples(np.arange(18832) * PERIOD_S) == 0
    assert lost_samples(np.array([0.0, 1.0])) == 0


@pytest.mark.parametrize("seed", range(5))
def test_times_without_a_fixed_rate_show_no_loss(seed: int) -> None:
    rng = np.random.default_rng(seed)
    assert lost_samples(np.cumsum(rng.exponential(0.07, 2000))) == 0
    batches = np.repeat(np.cumsum(rng.uniform(0.012, 0.02, 200)), 16) + np.tile(np.arange(16) * 1e-6, 200)
    assert lost_samples(batches) == 0


def test_the_limit_is_a_share_of_all_samples() -> None:
    assert too_many_lost(5, 995, 0.5) == ""
    assert too_many_lost(6, 994, 0.5) == "6 of 1000 samples were lost (0.6 %), more than the 0.5 % that the plan allows"
    assert too_many_lost(6, 994, 1.0) == ""


def test_only_what_is_missing_on_the_turn_is_lost() -> None:
    whole = trace(noise_mm=0.0003)
    before = replace(whole, t_s=whole.t_s + 27.0 * (np.arange(len(whole)) > 3))
    assert lost_samples(before.t_s) > 1000
    assert lost_on_turn(before, CIRCLE)[0] == 0
    middle = len(whole) // 2
    kept = np.delete(np.arange(len(whole)), slice(middle, middle + 60))
    holed = replace(whole, t_s=whole.t_s[kept], length_mm=whole.length_mm[kept])
    assert lost_on_turn(holed, CIRCLE)[0] == 60
    assert lost_on_turn(replace(holed, length_mm=holed.length_mm[0] + 0.0 * holed.length_mm), CIRCLE)[0] == 60


def test_loss_is_suspected_before_the_feed() -> None:
    whole = trace(feed=970, noise_mm=0.0003)
    kept = np.delete(np.arange(len(whole)), slice(3000, 3060))
    holed = replace(whole, t_s=whole.t_s[kept], length_mm=whole.length_mm[kept])
    with pytest.raises(TraceError, match=rf"60 of {len(whole)} samples were lost.*; .*a feed of") as refused:
        cut(holed, CIRCLE)
    assert refused.value.remedy.index("cable") < refused.value.remedy.index("feed")
    with pytest.raises(TraceError) as without:
        cut(Recording("a run", whole.t_s, whole.length_mm), CIRCLE)
    assert "lost" not in str(without.value)


def test_samples_that_cannot_be_used_are_missing_also_where_times_show_no_loss() -> None:
    whole = trace(noise_mm=0.0003)
    jitter = np.random.default_rng(3).uniform(-0.45, 0.45, len(whole)) * np.median(np.diff(whole.t_s))
    usable = np.ones(len(whole), dtype=bool)
    usable[2000:2400:8] = False
    asked = replace(whole, t_s=whole.t_s + jitter, usable=usable)
    assert lost_samples(asked.good.t_s) == 0
    assert lost_on_turn(asked, CIRCLE)[0] == 50
