"""Tables in which nothing is missing, under eight kinds of noise: hardly any has a name."""

from __future__ import annotations

import pytest

from tests.diagnosis.table.nulls import NOISES, identified_in, is_right


def among(kinds, of=tuple(NOISES)):
    """Every kind of noise; those that are not among `kinds` are nightly."""
    return [pytest.param(kind, marks=() if kind in kinds else pytest.mark.nightly) for kind in of]


pytestmark = pytest.mark.usefixtures("few_parts")

SHORT = {"white": (5001, 5004), "first-order": (5005, 5006), "long-tails": (5005, 5009)}
"""Seeds of tables of 300 to 404 rows."""


# One kind of each sort by default: independent rows, rows that remember, outliers, a size that follows a variable.
@pytest.mark.slow
@pytest.mark.parametrize("tables", [2, pytest.param(4, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("kind", among({"white", "first-order", "long-tails", "speed"}))
def test_noise_has_no_name(kind, tables):
    """At one false name in twenty tables two of two have one once in four hundred times, two of four once in seventy."""
    if kind == "low-passed" and tables > 2:
        pytest.skip("averaged noise takes ten times as long as others")
    seeds = SHORT.get(kind, ()) if tables == 2 else ()
    named = 0
    for left in reversed(range(tables)):
        named += bool(identified_in(kind, seeds[left] if seeds else 5000 + left))
        if named + left < 2:  # whatever the others are
            break
    assert named < 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "seed", "effects"),
    [
        ("long-tails", 7002, ("linear", "hysteresis")),  # 312 rows
        *(
            pytest.param(kind, 7001, ("linear", "hysteresis", "twice", "product"), marks=pytest.mark.nightly)
            for kind in ("resonant", "long-tails")
        ),
    ],
)
def test_effects_as_large_as_the_noise_keep_their_names(kind, seed, effects):
    named = {effect: identified_in(kind, seed, effect, 1.0, hold_out=False) for effect in effects}
    assert all(any(is_right(name, effect) for name in names) for effect, names in named.items())
    # At one false name in twenty tables, two of four have one once in seventy times.
    assert sum(any(not is_right(name, effect) for name in names) for effect, names in named.items()) < 2
