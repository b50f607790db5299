"""Tables in which nothing is missing, under eight kinds of noise: hardly any has a name."""

from __future__ import annotations

import pytest

from tests.diagnosis.table.nulls import NOISES, identified_in, is_right

TABLES = 4
"""Of each kind: at one false name in twenty tables two of four have one once in seventy times."""


def among(kinds, of=tuple(NOISES)):
    """Every kind of noise; those that are not among `kinds` are nightly."""
    return [pytest.param(kind, marks=() if kind in kinds else pytest.mark.nightly) for kind in of]


# One kind of each sort by default: independent rows, rows that remember, outliers, a size that follows a variable.
@pytest.mark.slow
@pytest.mark.parametrize("kind", among({"white", "first-order", "long-tails", "speed"}))
def test_noise_has_no_name(kind):
    # Averaged noise takes ten times as long as others.
    tables = TABLES // 2 if kind == "low-passed" else TABLES
    assert sum(bool(identified_in(kind, 5000 + k)) for k in range(tables)) < 2


@pytest.mark.slow
@pytest.mark.parametrize("kind", among({"long-tails"}, ("resonant", "long-tails")))
def test_effects_as_large_as_the_noise_keep_their_names(kind):
    effects = ("linear", "hysteresis", "twice", "product")
    named = {effect: identified_in(kind, 7001, effect, 1.0, hold_out=False) for effect in effects}
    assert all(any(is_right(name, effect) for name in names) for effect, names in named.items())
    # At one false name in twenty tables, two of four have one once in seventy times.
    assert sum(any(not is_right(name, effect) for name in names) for effect, names in named.items()) < 2
