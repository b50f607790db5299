"""`dbbstation instrument`: commands for length instruments; known instruments with their line settings, and serial ports."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import click

from dbbstation.cli.declared import Answer, made
from dbbstation.cli.instrument_options import PROFILE
from dbbstation.cli.lazy import LazyGroup
from dbbstation.cli.output import echo
from dbbstation.tasks.declare import Option

if TYPE_CHECKING:
    from dbbstation.instrument.protocol import Protocol


@made()
def instruments(
    name: Annotated[str | None, Option("instrument.", kind="argument-text")] = None,
    *,
    profile: Annotated[str | None, replace(PROFILE, setting="")] = None,
) -> Answer:
    r"""List the known instruments, or describe one: NAME, or a protocol file.

    \b
    Examples:
      dbbstation instrument list
      dbbstation instrument list heidenhain-nd281b
      dbbstation instrument list keyence-dl-rs1a --profile gt-70a
      dbbstation instrument list ./my-gauge.yaml
    """
    from dbbstation.instrument.library import known_instruments, load_instrument, load_variants
    from dbbstation.results.instruments import InstrumentsResult, instrument_result

    if name is not None:
        protocol = load_instrument(name, profile)
        names = [one.profile for one in load_variants(name) if one.profile]
        return Answer(instrument_result(protocol, names, whole=True), _details(protocol, names))
    if profile is not None:
        raise click.UsageError("--profile needs the name of an instrument")
    known = [load_variants(one) for one in known_instruments()]
    shown = (instrument_result(one[0], (each.profile for each in one if each.profile)) for one in known)
    lines: list[str] = []
    for variants in known:
        one, called = variants[0], ", ".join(each.profile for each in variants if each.profile)
        open_ones = sum(not each.verified for each in one.references)
        lines += [f"{one.name}" + (f" ({called})" if called else ""), f"    {one.title}"]
        lines.append(f"    {one.line.text}, about {one.fastest_hz():.0f} readings per second")
        if open_ones:
            lines.append(f"    {open_ones} of {len(one.references)} statements about it are not verified")
    return Answer(InstrumentsResult(tuple(shown)), lines)


EXAMPLE_MM = 150.00031
"""Length in the example frame [mm]; a display with a smaller range shows its greatest length."""

NO_CHECKSUM = (
    "none: damage shows only by parity, by how numbers are written, and where the feed does not allow a length"
)
"""Text about lines without a checksum."""


def _details(protocol: Protocol, profiles: list[str]) -> list[str]:
    from dbbstation.instrument.codec import decode, encode

    low_mm, high_mm = protocol.length.range_mm
    frame = encode(protocol, min(EXAMPLE_MM, high_mm))
    asked = f"asked with {protocol.ask.request.hex(' ')}" if protocol.ask.request else "streams"
    counter = protocol.counter_modulus
    lines = [
        protocol.title,
        *([f"  profile   {protocol.profile} (there are {', '.join(profiles)})"] if profiles else []),
        f"  line      {protocol.line.text}",
        f"  can be    {', '.join(str(rate) for rate in protocol.line.baud_choices) or protocol.line.baud} baud",
        f"  reading   {asked}, about {protocol.fastest_hz():.1f} per second",
        f'  example   "{repr(frame)[2:-1]}" is {decode(protocol, frame).length_mm:.5f} mm',
        f"  range     {low_mm:g} to {high_mm:g} mm",
        f"  checksum  {'yes' if protocol.has_checksum else NO_CHECKSUM}",
        f"  counter   {f'modulo {counter}: lost samples are seen' if counter else 'none'}",
    ]
    lines += ["", "Set on the instrument:", *(f"  - {step}" for step in protocol.setup)] if protocol.setup else []
    said = [f"  - {one.status}: {one.means}. {one.remedy[:1].upper()}{one.remedy[1:]}." for one in protocol.statuses]
    lines += ["", "What it can report:", *said] if said else []
    sources = [f"  - {'' if one.verified else 'NOT VERIFIED: '}{one.says}: {one.where}" for one in protocol.references]
    return lines + (["", "From:", *sources] if sources else [])


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


TABLE = {
    "emulate": "A virtual machine with a ball bar, on a line of its own.",
    "list": "The known instruments.",
    "monitor": "Live reading of an instrument.",
    "ports": "The serial ports of this computer.",
    "replay": "Send a byte log through an instrument's driver.",
}

instrument = LazyGroup(
    name="instrument",
    table=TABLE,
    package="dbbstation.cli",
    modules={"list": "instruments.instruments", "ports": "instruments.ports", "replay": "monitor.replay"},
    help="""List instruments and ports, read an instrument, decode its recorded bytes, or emulate one.

\b
Examples:
  dbbstation instrument list
  dbbstation instrument monitor --instrument heidenhain-nd281b --port /dev/ttyUSB0
""",
)
