"""`dbbstation instrument`: commands for length instruments."""

from __future__ import annotations

from dbbstation.cli.lazy import LazyGroup

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
    modules={"list": "instruments.instruments", "ports": "instruments.ports"},
    help="""List instruments and ports, read an instrument, decode its recorded bytes, or emulate one.

\b
Examples:
  dbbstation instrument list
  dbbstation instrument monitor --instrument heidenhain-nd281b --port /dev/ttyUSB0
""",
)
