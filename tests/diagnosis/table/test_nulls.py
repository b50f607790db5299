"""Tables in which nothing is missing, under eight kinds of noise: hardly any has a name."""

from __future__ import annotations

import pytest

from tests.diagnosis.table.nulls import NOISES, is_right, named_in

TABLES = 4
"""Of each kind: at one false name in twenty tables two of four have one once in seventy times."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", NOISES)
def test_noise_has_no_name(kind):
    assert sum(bool(named_in(kind, 5000 + k)[0]) for k in range(TABLES)) < 2


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["linear", "hysteresis", "twice", "product"])
@pytest.mark.parametrize("kind", ["resonant", "long-tails"])
def test_an_effect_as_large_as_the_noise_keeps_its_name(kind, effect):
    names, _ = named_in(kind, 7001, effect, 1.0)
    assert any(is_right(name, effect) for name in names)
    assert all(is_right(name, effect) for name in names)
