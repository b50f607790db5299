"""Test whether a column may be a consequence of the difference instead of its cause."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import fdtrc

from dbbstation.inference.detectable import ENTIRELY
from dbbstation.inference.left_over import SIGNIFICANT
from dbbstation.inference.triangle import left_by, squares

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.channel import Channel
    from dbbstation.inference.variables import Variable

DETERMINED = 0.9
"""Share of a column's squares that the simulated value and its first two derivatives must explain for a column of the
motion itself, such as a torque. For a merely correlated column, such as a temperature, the share is smaller."""

CARRIES = 0.5
"""Share of the remaining squares that the difference and its derivatives must explain: more than all other variables together."""


def may_result(variable: Variable, channel: Channel) -> bool:
    """Return whether a column may be a consequence of the difference as well as its cause."""
    # A measured torque follows the actual motion and so contains the difference. A cause also contains it. These rows
    # cannot distinguish both.
    if channel.simulated is None or channel.time is None:
        return False
    kept, values = channel.kept, variable.values[channel.kept]
    simulated, carried = (
        _with_derivatives(values, channel.time, channel.blocks)[kept]
        for values in (channel.simulated.values, channel.residual)
    )
    whole = squares(values - values.mean())
    left, both = (squares(left_by(by, values)) for by in (simulated, np.hstack([simulated, carried])))
    if not ENTIRELY * whole < left <= (1.0 - DETERMINED) * whole or both > (1.0 - CARRIES) * left:
        return False
    free = len(values) - simulated.shape[1] - carried.shape[1]
    more = carried.shape[1]
    return free > 0 and float(fdtrc(more, free, (left - both) / more / max(both / free, 1e-300))) < SIGNIFICANT


def _with_derivatives(values: Floats, time: Floats, blocks: Sequence[slice]) -> Floats:
    """Return a constant, values, and their first two derivatives by central differences, shape (n, 4)."""
    found = np.column_stack([np.ones(len(values)), values, np.zeros((len(values), 2))])
    for rows in blocks:
        if rows.stop - rows.start > 2 and np.all(np.diff(time[rows]) > 0.0):  # noqa: PLR2004 - a second difference
            found[rows, 2] = np.gradient(values[rows], time[rows])
            found[rows, 3] = np.gradient(found[rows, 2], time[rows])
    return found
