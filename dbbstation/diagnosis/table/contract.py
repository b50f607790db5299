"""The interface of a user's physics for tables."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

from dbbstation.sources.contract import Parameter as Parameter  # noqa: PLC0414, TC001 - part of the interface
from dbbstation.text.texts import Texts as Texts  # noqa: PLC0414, TC001 - part of the interface

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.computing.arrays import Floats


class TableSource(ABC):
    """A physical cause of a difference; instances have no state."""

    name: ClassVar[str]
    """Unique, in small letters with hyphens."""

    needs: ClassVar[tuple[str, ...]]
    """Columns of the table that it needs; it is omitted for a table without them."""

    texts: ClassVar[Texts]

    form_uncertainty: ClassVar[float] = 0.02
    """Relative standard deviation of real objects from the formula: 0.02 for springs and geometry, 0.1 to 0.3 for
    friction, play and warm-up."""

    follows: ClassVar[str] = ""
    """Column over which they depart; if empty, the first needed one."""

    @abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """Return amplitudes, and nonlinear parameters with a `grid`."""

    @abstractmethod
    def columns(self, variables: Mapping[str, Floats], shapes: Mapping[str, float]) -> Floats:
        """Return the effect of unit amplitudes, shape (n, p), in the measured unit."""
