"""The contract of own physics at a port."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

from dbbstation.sources.contract import Parameter as Parameter  # noqa: PLC0414, TC001 - part of the contract

if TYPE_CHECKING:
    from collections.abc import Mapping


class PortSource(ABC):
    """A physical cause at a port, without state."""

    name: ClassVar[str]
    """Unique, in small letters with hyphens."""

    port: ClassVar[str]
    """Port of `model.yaml` at which it acts."""

    @abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """Return amplitudes, then numbers with a `grid`."""

    @abstractmethod
    def value(self, t: float, signals: Mapping[str, float], parameters: Mapping[str, float]) -> float:
        """Return what acts at the port, in its unit."""
