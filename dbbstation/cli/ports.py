"""`dbbstation instrument ports`: what is connected."""

from __future__ import annotations

from dbbstation.cli.declared import made
from dbbstation.cli.output import echo
from dbbstation.tasks import options as o


@made()
def ports(*, as_json: o.Json = False) -> None:
    r"""List the serial ports of this computer.

    \b
    Example:
      dbbstation instrument ports
    """
    from dbbstation.cli.output import print_json
    from dbbstation.instrument.link import connected_ports

    found = connected_ports()
    if as_json:
        keys = ("port", "description", "hardware")
        print_json({"ports": [dict(zip(keys, port, strict=True)) for port in found]})
        return
    if not found:
        echo("No serial port is connected: plug in the adapter of the instrument.", err=True)
    for port, description, hardware in found:
        echo(f"{port:16} {description}" + (f"  ({hardware})" if hardware not in {"", "n/a"} else ""))
