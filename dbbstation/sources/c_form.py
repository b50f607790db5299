"""An error source's effect as C, for a kinematics inside a control."""

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

    They may use names of `control/kernel.c`: `at`, the struts as the source sees them in its model; `e`, the sum to add
    to; `v`, the values; `EACH`, a loop over struts i. Thermometer k is `warmer[thermometer[k]]`, in kelvin above its
    zero.

    Attributes:
        by_pose: False if it uses only lengths of `at`, so that the pose need not be solved for.
        constants: further constants by name, a number or an array.
        thermometers: columns without their unit.
    """

    body: str
    by_pose: bool = True
    constants: Mapping[str, ArrayLike] = field(default_factory=dict)
    thermometers: tuple[str, ...] = ()


def c_constant(name: str, value: ArrayLike) -> str:
    """Return the definition of a number or an array, exact to the last bit."""
    array = np.asarray(value)
    kind = "int" if np.issubdtype(array.dtype, np.integer) else "double"
    shape = "".join(f"[{n}]" for n in array.shape)
    return f"static const {kind} {name}{shape} = {str(array.tolist()).translate(_BRACES)};"


_BRACES = str.maketrans("[]", "{}")
