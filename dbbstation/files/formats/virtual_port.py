"""Port names that mean a virtual machine in this program."""

import re

SLOWEST, FASTEST = 0.01, 50.0
"""Slowest and fastest speed of a virtual machine relative to real time: slower ones seem to stand still, and computers
are too slow for faster ones."""

_NAME = "virtual machine"
_NAMED = re.compile(rf"{_NAME}(?:, ([0-9]+(?:\.[0-9]+)?) times faster)?")


def virtual_port(time_scale: float = 1.0) -> str:
    """Return the port name of a virtual machine."""
    return _NAME if time_scale == 1.0 else f"{_NAME}, {time_scale:g} times faster"


def time_scale_of(port: str) -> float | None:
    """Return the virtual machine's speed relative to real time; None for a real port."""
    named = _NAMED.fullmatch(port)
    if named is None:
        return None
    scale = float(named[1] or 1.0)
    return scale if SLOWEST <= scale <= FASTEST else None


def misspelt(port: str) -> bool:
    """Return whether a name is a misspelt name of a virtual machine."""
    return port.strip().lower().startswith("virtual") and time_scale_of(port) is None
