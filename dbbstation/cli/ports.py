"""`dbbstation instrument ports`: list connected serial ports."""

from __future__ import annotations

from dbbstation.cli.declared import Answer, made
from dbbstation.cli.output import echo


@made()
def ports() -> Answer:
    r"""List the serial ports of this computer.

    \b
    Example:
      dbbstation instrument ports
    """
    from dbbstation.instrument.link import connected_ports

    found = connected_ports()
    keys = ("port", "description", "hardware")

    def words() -> None:
        if not found:
            echo("No serial port is connected: plug in the adapter of the instrument.", err=True)
        for port, description, hardware in found:
            echo(f"{port:16} {description}" + (f"  ({hardware})" if hardware not in {"", "n/a"} else ""))

    return Answer({"ports": [dict(zip(keys, port, strict=True)) for port in found]}, words)
