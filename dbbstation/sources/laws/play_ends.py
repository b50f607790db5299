"""Which end of its play a drive leans on when a run begins.

It is compiled into the kernels of `backlash` and `play`, whose code on disk does not notice a change here: whoever changes
it deletes the `*.nbi` of both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.machine.compiled import inlined

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@inlined
def first_side(travel: NDArray[np.float64]) -> float:
    """Return where a strut stands at first, as a share of its play, as if its first movement had gone on before.

    -1/2 behind a strut that grows, +1/2 behind one that shrinks, 0 for one that never moves; travel has shape (n,).
    """
    for k in range(1, len(travel)):
        if travel[k] != travel[0]:
            return -0.5 if travel[k] > travel[0] else 0.5
    return 0.0
