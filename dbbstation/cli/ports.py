"""`dbbstation instrument ports`: what is connected."""

from __future__ import annotations

import click

from dbbstation.cli.output import echo


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def ports(*, as_json: bool) -> None:
    """List the serial ports of this computer.

    \b
    Example:
      dbbstation instrument ports
    """  # noqa: D301 (click reads the escape)
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
