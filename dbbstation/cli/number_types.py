"""Option types for finite numbers."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from click import Context, Parameter


class Finite(click.FloatRange):
    """A finite number, with a range as of `click.FloatRange`.

    `nan` is in every range, and `inf` in open ones.
    """

    def __init__(self, *limits: Any, **more: Any) -> None:  # noqa: ANN401 - as click has it
        super().__init__(*limits, **more)
        if self.min is None and self.max is None:
            self.name = "float"  # what help texts show

    def convert(self, value: Any, param: Parameter | None, ctx: Context | None) -> float:  # noqa: ANN401 - as click has it
        """Return the number.

        Raises:
            BadParameter: it is no number, not finite, or out of range.
        """
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number", param, ctx)
        return number

    def _describe_range(self) -> str:
        return "" if self.min is None and self.max is None else super()._describe_range()
