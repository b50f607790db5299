"""The results of `control`."""

from __future__ import annotations

from dataclasses import dataclass

from dbbstation.control.parameters import LeftOfModel, SourceLeft


@dataclass(frozen=True, kw_only=True)
class KinematicsResult:
    """Output of `control kinematics`.

    Attributes:
        model_sha256: of the model file; the component's pin `model` has its first 32 bits.
        thermometers: columns whose pins must be connected.
        machine_file: machine file for use with the component; it states the control's corrections.
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


@dataclass(frozen=True, kw_only=True)
class ParametersResult:
    """Output of `control parameters`.

    Attributes:
        low: lower end of the volume, X, Y, Z [mm], A, B, C [deg].
        home_mm: added to HOME and HOME_OFFSET of each joint.
    """

    folder: str
    files: tuple[str, ...]
    model_sha256: str
    low: tuple[float, ...]
    high: tuple[float, ...]
    left: tuple[LeftOfModel, ...]
    sources: tuple[SourceLeft, ...]
    home_mm: tuple[float, ...]
    ini: tuple[str, ...]
    way_back: tuple[str, ...]
    notes: tuple[str, ...]
