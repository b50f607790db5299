"""Digits of values with their uncertainty, held against the examples of the GUM and against decimal arithmetic."""

from __future__ import annotations

import math
from decimal import ROUND_HALF_EVEN, Decimal

import numpy as np
import pytest

from dbbstation.facts.digits import to_its_place
from dbbstation.facts.value import Value


@pytest.mark.parametrize(
    ("value", "u", "shown"),
    [
        (100.02147, 0.00035, "100.02147 ± 0.00035 g"),  # [GUM 7.2.2]
        (10.05762, 0.027, "10.058 ± 0.027 g"),  # [GUM 7.2.6]
        (0.000123, 3.44, "0.0 ± 3.4 g"),
        (-0.02, 0.996, "0.0 ± 1.0 g"),  # 0.996 rounds to 1.0; no minus before zero
        (12345.6, 234.0, "12350 ± 230 g"),
        (3.4012e-9, 1.21e-10, "3.40e-09 ± 1.2e-10 g"),
        (5.0, 0.0, "5 ± 0 g"),
        (1.23456, math.nan, "1.235 g"),
    ],
)
def test_a_value_is_said_to_the_place_of_its_uncertainty(value: float, u: float, shown: str) -> None:
    assert Value(value, u, "g").in_words == shown


def test_two_digits_of_u_and_the_value_to_the_same_place() -> None:
    rng = np.random.default_rng(57)
    for value, u in zip(
        rng.normal(0.0, 1e3, 200).tolist(), (10.0 ** rng.uniform(-4.0, 5.0, 200)).tolist(), strict=True
    ):
        shown, shown_u = to_its_place(value, u)
        exact = Decimal(u)
        place = Decimal((0, (1,), exact.adjusted() - 1))
        rounded = exact.quantize(place, ROUND_HALF_EVEN)
        if rounded.adjusted() > exact.adjusted():  # 0.0996 is 0.10
            place *= 10
        assert Decimal(shown_u) == rounded
        assert Decimal(shown) == (Decimal(value) / place).quantize(Decimal(1), ROUND_HALF_EVEN) * place
        assert len(shown.partition(".")[2]) == max(-place.adjusted(), 0)
