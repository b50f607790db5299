"""With which digits numbers are written."""

from __future__ import annotations

import math

MOST_DECIMALS = 3
"""Decimals of the finest figures, in µm: a nanometre."""

SIGNIFICANT = 2
"""Number of significant digits of an uncertainty."""


def expanded_uncertainty(u: float | None, coverage_factor: float) -> float | None:
    """Return U = k u; None if u is not known."""
    return None if u is None else coverage_factor * u


LONGEST = 6
"""Number of decimals or rounded zeros above which a number has an exponent."""


def decimals_of(expanded: float) -> int:
    """Return the decimals of a value with this expanded uncertainty."""
    return min(max(_place(expanded), 0), MOST_DECIMALS) if expanded > 0.0 else MOST_DECIMALS


def _place(uncertainty: float) -> int:
    """Return the decimal place of an uncertainty's last significant digit."""
    shown = float(f"{uncertainty:.{SIGNIFICANT - 1}e}")  # 0.0996 is written as 0.10
    return SIGNIFICANT - 1 - math.floor(math.log10(shown))


def to_its_place(value: float, uncertainty: float) -> tuple[str, str]:
    """Return a value and its uncertainty, rounded to two significant digits of the uncertainty [GUM 7.2.6]."""
    if not (0.0 < uncertainty < math.inf and math.isfinite(value)):
        return f"{value:.4g}", f"{uncertainty:.2g}"
    place = _place(uncertainty)
    if abs(place) <= LONGEST:
        rounded = (round(value, place), round(uncertainty, place))
        return f"{rounded[0]:z.{max(place, 0)}f}", f"{rounded[1]:.{max(place, 0)}f}"
    digits = 0 if value == 0.0 else math.floor(math.log10(abs(value))) + place
    return f"{value:z.{max(digits, 0)}e}", f"{uncertainty:.{SIGNIFICANT - 1}e}"


def with_uncertainty(value: float, expanded: float | None) -> tuple[str, str]:
    """Return a value and its expanded uncertainty as text with the same decimals."""
    if expanded is None:
        return f"{value:z.1f}", "-"
    decimals = decimals_of(expanded)
    return f"{value:z.{decimals}f}", f"{expanded:.{decimals}f}"
