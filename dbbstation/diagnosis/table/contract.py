"""The contract of own physics on a table."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

from dbbstation.sources.contract import Parameter as Parameter  # noqa: PLC0414, TC001 - part of the contract
from dbbstation.text.texts import Texts as Texts  # noqa: PLC0414, TC001 - part of the contract

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.computing.arrays import Floats


class TableSource(ABC):
    """A physical cause of a difference, without state."""

    name: ClassVar[str]
    """Unique, in small letters with hyphens."""

    needs: ClassVar[tuple[str, ...]]
    """Columns of the table that it is computed from; a table without them is compared without it."""

    texts: ClassVar[Texts]

    form_uncertainty: ClassVar[float] = 0.02
    """Share of its effect by which real objects depart from the formula, one standard deviation: 0.02 for springs and geometry,
    0.1 to 0.3 for friction, play and warm-ups."""

    follows: ClassVar[str] = ""
    """Column along which they do; the first one that it needs if empty."""

    @abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """Return amplitudes, and numbers with a `grid`."""

    @abstractmethod
    def columns(self, variables: Mapping[str, Floats], shapes: Mapping[str, float]) -> Floats:
        """Return the effect of unit amplitudes, shape (n, p), in the measured unit."""
