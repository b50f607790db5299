"""The interface of a user's physics at a port."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

from dbbstation.sources.contract import Parameter as Parameter  # noqa: PLC0414, TC001 - part of the interface

if TYPE_CHECKING:
    from collections.abc import Mapping


class PortSource(ABC):
    """A physical cause at a port; instances have no state."""

    name: ClassVar[str]
    """Unique, in small letters with hyphens."""

    port: ClassVar[str]
    """Port of `model.yaml` at which it acts."""

    @abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """Return amplitudes, then nonlinear parameters with a `grid`."""

    @abstractmethod
    def value(self, t: float, signals: Mapping[str, float], parameters: Mapping[str, float]) -> float:
        """Return the value at the port, in its unit."""
