"""Serial adapters by USB identity, because a replugged cable may get another port name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from serial.tools import list_ports

if TYPE_CHECKING:
    from collections.abc import Iterable

    from serial.tools.list_ports_common import ListPortInfo


@dataclass(frozen=True, slots=True)
class Adapter:
    """The identity of a USB adapter.

    Attributes:
        socket: USB socket, decisive only without serial number.
    """

    vendor: int
    product: int
    serial_number: str
    socket: str

    @property
    def text(self) -> str:
        """Return the identity in words: vendor:product and serial number or socket."""
        own = self.serial_number or f"in USB socket {self.socket}"
        return f"{self.vendor:04x}:{self.product:04x} {own}".strip()


def adapter_of(port: str) -> Adapter | None:
    """Return the adapter of a port, or None if the port is not USB or has gone."""
    return next((adapter for name, adapter in _adapters(list_ports.comports()) if name == port), None)


def port_of(adapter: Adapter) -> str | None:
    """Return the adapter's current port, or None.

    For an adapter without serial number, the socket alone decides.
    """
    return next((name for name, other in _adapters(list_ports.comports()) if _same(adapter, other)), None)


def _adapters(ports: Iterable[ListPortInfo]) -> list[tuple[str, Adapter]]:
    return [
        (port.device, Adapter(port.vid, port.pid, port.serial_number or "", port.location or ""))
        for port in ports
        if port.vid is not None and port.pid is not None
    ]


def _same(one: Adapter, other: Adapter) -> bool:
    if (one.vendor, one.product, one.serial_number) != (other.vendor, other.product, other.serial_number):
        return False
    return bool(one.serial_number) or one.socket == other.socket
