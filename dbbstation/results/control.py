"""The results of `control`."""

from __future__ import annotations

from dataclasses import dataclass


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
class LeftByWay:
    """Errors of the tool over the volume with one set-up of the control: position and tilt, rms and largest."""

    way: str
    rms_um: float
    largest_um: float
    tilt_rms_deg: float
    tilt_largest_deg: float


@dataclass(frozen=True, kw_only=True)
class SourceLeftOver:
    """Errors of the tool by one source alone, without and with parameters and tables."""

    name: str
    rms_um: float | None
    left_rms_um: float | None
    held_by: str


@dataclass(frozen=True, kw_only=True)
class ParametersResult:
    """Output of `control parameters`.

    Attributes:
        low: of the volume, X, Y, Z [mm], A, B, C [deg].
        home_mm: added to HOME and HOME_OFFSET of each joint.
    """

    folder: str
    files: tuple[str, ...]
    model_sha256: str
    low: tuple[float, ...]
    high: tuple[float, ...]
    left: tuple[LeftByWay, ...]
    sources: tuple[SourceLeftOver, ...]
    home_mm: tuple[float, ...]
    ini: tuple[str, ...]
    way_back: tuple[str, ...]
    notes: tuple[str, ...]
