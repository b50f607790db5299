"""What stands where the name of a port stands, and means a virtual machine in this program."""

import re

SLOWEST, FASTEST = 0.01, 50.0
"""Factors by which a virtual machine may run faster than real time: below it stands still for who looks on, above it computers do not keep up."""

_NAME = "virtual machine"
_NAMED = re.compile(rf"{_NAME}(?:, ([0-9]+(?:\.[0-9]+)?) times faster)?")


def virtual_port(time_scale: float = 1.0) -> str:
    """Return what stands where a real session has the name of a port.

    Args:
        time_scale: how much faster than real time the virtual machine goes.
    """
    return _NAME if time_scale == 1.0 else f"{_NAME}, {time_scale:g} times faster"


def time_scale_of(port: str) -> float | None:
    """Return how much faster than real time the virtual machine of a port goes; None where it is the name of a real port."""
    named = _NAMED.fullmatch(port)
    if named is None:
        return None
    scale = float(named[1] or 1.0)
    return scale if SLOWEST <= scale <= FASTEST else None


def misspelt(port: str) -> bool:
    """Whether a name begins like that of a virtual machine and is none: no system calls a port so."""
    return port.strip().lower().startswith("virtual") and time_scale_of(port) is None
