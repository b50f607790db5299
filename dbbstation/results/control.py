"""The results of `control`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class KinematicsResult:
    """What `control kinematics` wrote.

    Attributes:
        model_sha256: of the model file; the component's pin `model` has its first 32 bits.
        parts: sources that the component corrects.
        left_out: sources that it does not.
        thermometers: columns whose pins must be connected.
        install: commands, in order.
        ini: lines for the INI file.
        hal: lines for the HAL file.
        machine_file: machine file to use once the component is in use; it says what the control corrects.
        way_back: what undoes it.
    """

    file: str
    name: str
    model_sha256: str
    parts: tuple[str, ...]
    left_out: tuple[str, ...]
    thermometers: tuple[str, ...]
    install: tuple[str, ...]
    ini: tuple[str, ...]
    hal: tuple[str, ...]
    machine_file: str
    way_back: tuple[str, ...]
    notes: tuple[str, ...]
