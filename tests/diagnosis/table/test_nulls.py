"""Tables in which nothing is missing, under eight kinds of noise: hardly any has a name."""

from __future__ import annotations

import pytest

from tests.diagnosis.table.nulls import NOISES, identified_in, is_right

TABLES = 4
"""Of each kind: at one false name in twenty tables two of four have one once in seventy times."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", NOISES)
def test_noise_has_no_name(kind):
    # Averaged noise takes ten times as long as others.
    tables = TABLES // 2 if kind == "low-passed" else TABLES
    assert sum(bool(identified_in(kind, 5000 + k)) for k in range(tables)) < 2


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["resonant", "long-tails"])
def test_effects_as_large_as_the_noise_keep_their_names(kind):
    effects = ("linear", "hysteresis", "twice", "product")
    named = {effect: identified_in(kind, 7001, effect, 1.0, hold_out=False) for effect in effects}
    assert all(any(is_right(name, effect) for name in names) for effect, names in named.items())
    # At one false name in twenty tables, two of four have one once in seventy times.
    assert sum(any(not is_right(name, effect) for name in names) for effect, names in named.items()) < 2
