"""Make a law of a comparison from stated physics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.inference.channel import Law

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.computing.arrays import Floats
    from dbbstation.laws.contract import SourceForm


def law_of(
    name: str,
    form: SourceForm,
    columns: Callable[[tuple[float, ...]], Floats],
    **further: Any,  # noqa: ANN401 - fields of `Law`
) -> Law:
    """Return a law.

    Args:
        columns: function from nonlinear parameters to columns of amplitudes, shape (n, p).
        further: other fields of `Law`.
    """
    amplitudes, shapes = form.amplitudes, form.shapes
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
