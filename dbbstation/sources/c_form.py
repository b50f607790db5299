"""Error sources as C code for a kinematics inside a control."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike


@dataclass(frozen=True, eq=False)
class CForm:
    """Statements of C that add a source's effect at one pose.

    They may use names of `control/kernel.c`: `at`, the source's struts; `e`, the sum of effects; `v`, the values;
    `EACH`, a loop over struts i. The expression `warmer[thermometer[k]]` is thermometer k's excess over its zero [K].

    Attributes:
        by_pose: False if it uses only lengths of `at`, so the pose need not be computed.
        constants: further numbers or arrays by name.
        thermometers: columns without their unit.
    """

    body: str
    by_pose: bool = True
    constants: Mapping[str, ArrayLike] = field(default_factory=dict)
    thermometers: tuple[str, ...] = ()


def c_constant(name: str, value: ArrayLike) -> str:
    """Return the C definition of a number or an array, exact to the last bit."""
    array = np.asarray(value)
    kind = "int" if np.issubdtype(array.dtype, np.integer) else "double"
    shape = "".join(f"[{n}]" for n in array.shape)
    return f"static const {kind} {name}{shape} = {str(array.tolist()).translate(_BRACES)};"


_BRACES = str.maketrans("[]", "{}")
