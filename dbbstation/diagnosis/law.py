"""Make a law of a comparison from stated physics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.inference.channel import Law

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.sources.contract import Parameter


def law_of(
    name: str,
    parameters: Sequence[Parameter],
    columns: Callable[[tuple[float, ...]], Floats],
    **further: Any,  # noqa: ANN401 - fields of `Law`
) -> Law:
    """Return a law.

    Args:
        parameters: amplitudes, and nonlinear parameters with a `grid`.
        columns: function from nonlinear parameters to columns of amplitudes, shape (n, p).
        further: other fields of `Law`.
    """
    amplitudes, shapes = [p for p in parameters if not p.grid], [p for p in parameters if p.grid]
    return Law(
        name=name,
        columns=columns,
        plausible=np.array([p.plausible for p in amplitudes]),
        parameters=tuple(p.name for p in (*amplitudes, *shapes)),
        units=tuple(p.unit for p in (*amplitudes, *shapes)),
        grids=tuple(tuple(p.grid) for p in shapes),
        positive=tuple(p.positive for p in amplitudes),
        **further,
    )
