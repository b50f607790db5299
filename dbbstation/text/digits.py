"""Decimals of a value: its expanded uncertainty has two significant digits [GUM 7.2.6]."""

from __future__ import annotations

import math

MOST_DECIMALS = 3
"""Decimals of the finest figures, in µm: a nanometre."""

SIGNIFICANT = 2
"""Digits of an uncertainty that count."""


def expanded_uncertainty(u: float | None, coverage_factor: float) -> float | None:
    """Return U = k u; None if u is not known."""
    return None if u is None else coverage_factor * u


def decimals_of(expanded: float) -> int:
    """Return the decimals of a value with this expanded uncertainty."""
    if not expanded > 0.0:
        return MOST_DECIMALS
    shown = float(f"{expanded:.{SIGNIFICANT - 1}e}")  # 0.0996 is written as 0.10
    return min(max(SIGNIFICANT - 1 - math.floor(math.log10(shown)), 0), MOST_DECIMALS)


def with_uncertainty(value: float, expanded: float | None, plain: int = 1) -> tuple[str, str]:
    """Return a value and its expanded uncertainty as printed, to the same decimals."""
    if expanded is None:
        return f"{value:z.{plain}f}", "-"
    decimals = decimals_of(expanded)
    return f"{value:z.{decimals}f}", f"{expanded:.{decimals}f}"
