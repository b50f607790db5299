"""Probabilities averaged over noise models, against Bayes' formula."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dbbstation.inference.settle import Settled


def test_noise_models_count_by_their_own_probabilities():
    bank = SimpleNamespace(kind_of=lambda name: name[0])
    other = SimpleNamespace(
        causes=[SimpleNamespace(name="a2"), SimpleNamespace(name="b1")],
        bank=bank,
        posterior=SimpleNamespace(probability=lambda names: 0.2 if names == ["a1", "a2"] else np.nan),
        log_probability=np.log(0.3),
    )
    own = SimpleNamespace(probability=lambda names: 0.8 if names == ["a1"] else np.nan)
    alone = Settled(
        channel=None, bank=bank, noise=None, causes=(), comparison=None, posterior=own, log_probability=np.log(0.1)
    )
    assert alone.probability(["a1"]) == pytest.approx(0.8)
    assert replace(alone, others=(other,)).probability(["a1"]) == pytest.approx((0.1 * 0.8 + 0.3 * 0.2) / 0.4)
