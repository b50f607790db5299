"""The contract of physics of one's own at a port of a simulator."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

from dbbstation.sources.contract import Parameter as Parameter  # noqa: PLC0414, TC001 - part of the contract

if TYPE_CHECKING:
    from collections.abc import Mapping


class PortSource(ABC):
    """One physical cause that acts at a port. Instances carry no state."""

    name: ClassVar[str]
    """Unique, in small letters with hyphens."""

    port: ClassVar[str]
    """Port of `model.yaml` at which it acts."""

    @abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """Return its numbers: amplitudes first, which it is proportional to, then those with a `grid`, which it is not."""

    @abstractmethod
    def value(self, t: float, signals: Mapping[str, float], parameters: Mapping[str, float]) -> float:
        """Return what acts at the port, in its unit.

        Args:
            t: time [s].
        """
