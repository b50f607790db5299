"""Find, read and check protocol files, with their variants of a device: firmware, resolution, amplifier."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from dbbstation.catalogue import files_of_packages, looked_up, nearest
from dbbstation.errors import InputError, InstrumentError, Problem, refuse
from dbbstation.files.places import shipped_folder
from dbbstation.files.yaml.schema import Partly, Schema, validate
from dbbstation.files.yaml.text import load_yaml
from dbbstation.instrument.frame import Frame  # noqa: TC001 (pydantic needs it at run time)
from dbbstation.instrument.protocol import Ask, Length, LineSettings, Name, Protocol, Reference, Reply, Timing

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.files.yaml.text import Location, YamlDocument


class Profile(Schema):
    """One variant: its keys replace keys of the file. A list is replaced as a whole, and a profile cannot remove a key.

    Attributes:
        references: added to the references of the file.
    """

    title: str = Field(min_length=1)
    setup: tuple[str, ...] | None = None
    references: tuple[Reference, ...] = ()
    features: tuple[str, ...] | None = None
    line: Annotated[Any, Partly(LineSettings)] = None
    ask: Annotated[Any, Partly(Ask)] = None
    reply: Annotated[Any, Partly(Reply)] = None
    length: Annotated[Any, Partly(Length)] = None
    frames: tuple[Frame, ...] | None = None
    timing: Annotated[Any, Partly(Timing)] = None


class ProtocolFile(Protocol):
    """A protocol file with all variants; `profile` names the usual one."""

    profiles: dict[Name, Profile] = Field(default_factory=dict)


def variant(document: YamlDocument, name: str) -> Protocol | None:
    """Return one variant of a protocol file; None with faults added.

    Args:
        document: valid as a `ProtocolFile`.
        name: one not under `profiles` is the usual one.
    """
    chosen = _merged(document, name if name in document.data.get("profiles", {}) else "")
    protocol = validate(chosen, Protocol)
    return None if protocol is None else protocol.whole()


def _merged(document: YamlDocument, name: str) -> YamlDocument:
    data = {key: value for key, value in document.data.items() if key != "profiles"}
    values, keys = dict(document.value_places), dict(document.key_places)
    if name:
        instead = document.data["profiles"][name]
        data = _over(data, instead) | {"profile": name}
        if "references" in instead:
            data["references"] = (*document.data.get("references", ()), *instead["references"])
        before: Location = ("profiles", name)
        for places in (values, keys):
            for place in [place for place in places if len(place) > len(before) and place[: len(before)] == before]:
                places[place[len(before) :]] = places[place]
    keys = {place: where for place, where in keys.items() if place[:1] != ("profiles",)}
    return replace(document, data=data, value_places=values, key_places=keys)


def _over(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, object]:
    both = dict(below)
    for key, value in above.items():
        whole = not (isinstance(value, dict) and isinstance(below.get(key), dict))
        both[key] = value if whole else _over(below[key], value)
    return both


GROUP = "dbbstation.instruments"
"""Entry points of this group name packages; every `.yaml` file in such a package's folder is an instrument."""

HOW_TO_ADD = "or give the path of your own file, as in `--instrument ./my-gauge.yaml`, or install its package"
"""Advice for an unknown name."""


def instruments_folder() -> Path:
    """Return the folder of shipped instruments."""
    return shipped_folder("protocols") / "instruments"


def known_instruments() -> list[str]:
    """Return the sorted names of shipped and installed instruments.

    Raises:
        InputError: an invalid entry point, or a taken name.
    """
    return list(_files())


def _files() -> dict[str, Path]:
    return files_of_packages(GROUP, instruments_folder().glob("*.yaml"), called="an instrument")


def load_instrument(name_or_file: str | Path, profile: str | None = None) -> Protocol:
    """Return the protocol of a known instrument or a `.yaml` file.

    Raises:
        InstrumentError: unknown instrument or profile.
        InputError: every fault of the file with line and column.
    """
    return read_protocol(_file_of(name_or_file), profile)


def load_variants(name_or_file: str | Path) -> list[Protocol]:
    """Return every variant of an instrument, the usual one first.

    Raises:
        InstrumentError, InputError: as `load_instrument`.
    """
    return list(_read(_file_of(name_or_file)).values())


def _file_of(name_or_file: str | Path) -> Path:
    path = Path(name_or_file)
    if path.suffix in {".yaml", ".yml"}:
        return path
    return looked_up(str(name_or_file), _files(), called="instrument", error=InstrumentError, how_to_add=HOW_TO_ADD)


def with_zero(protocol: Protocol, zero_mm: float | None) -> Protocol:
    """Return a relative device's protocol with the length at its zero.

    Raises:
        InstrumentError: a relative device without zero, or a zero for another device.
    """
    if protocol.length.relative == (zero_mm is not None):
        return protocol if zero_mm is None else _at_zero(protocol, zero_mm)
    if zero_mm is None:
        what = "it shows how far the bar is from its zero, and nobody says how long the bar is there"
        raise InstrumentError(what, where=protocol.label, remedy="give the calibrated length with --zero-mm")
    what = "it shows whole lengths, and has no zero to be added"
    raise InstrumentError(what, where=protocol.label, remedy="leave out --zero-mm; preset the device on the calibrator")


def _at_zero(protocol: Protocol, zero_mm: float) -> Protocol:
    length = protocol.length
    low_mm, high_mm = length.range_mm
    moved = {"zero_mm": zero_mm, "range_mm": (low_mm + zero_mm, high_mm + zero_mm)}
    return protocol.model_copy(update={"length": length.model_copy(update=moved)})


def at_rate(protocol: Protocol, rate_hz: float | None) -> Protocol:
    """Return the protocol with another sample rate, if one is given."""
    if rate_hz is None:
        return protocol
    return protocol.model_copy(update={"timing": protocol.timing.model_copy(update={"rate_hz": rate_hz})})


def read_protocol(path: Path, profile: str | None = None) -> Protocol:
    """Return the protocol of a file with this profile, or with the usual one.

    Raises:
        InstrumentError: the file has no such profile.
        InputError: every fault of the file with line and column.
    """
    variants = _read(path)
    first = next(iter(variants.values()))
    if not profile:
        return first
    if profile not in variants:
        names = [name for name in variants if name]
        remedy = nearest(profile, names) if names else "leave out --profile: its file has none"
        raise InstrumentError(f"{first.name} has no profile {profile!r}", remedy=remedy)
    return variants[profile]


def _read(path: Path) -> dict[str, Protocol]:
    faults: list[Problem] = []
    document = load_yaml(path, faults)
    file = validate(document, ProtocolFile) if document is not None else None
    if document is None or file is None:
        raise InputError(faults)
    if file.name != path.stem:
        remedy = f"rename the file to {file.name}.yaml or change the name in it"
        document.fault(("name",), f"the name {file.name!r} is not the file's", remedy)
    variants = {name: variant(document, name) for name in (file.profile, *file.profiles)}
    refuse(set(faults))
    return {name: one for name, one in variants.items() if one is not None}
