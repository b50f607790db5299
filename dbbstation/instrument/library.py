"""The protocol files: finding, reading, checking them."""

from __future__ import annotations

from pathlib import Path

from dbbstation.catalogue import looked_up
from dbbstation.errors import InputError, InstrumentError, Problem
from dbbstation.files.shipped import shipped_folder
from dbbstation.files.yaml.schema import validate
from dbbstation.files.yaml.text import load_yaml
from dbbstation.instrument.protocol import Protocol

HOW_TO_ADD = "or give a .yaml file of your own"
"""What a name that nobody knows may lack."""


def instruments_folder() -> Path:
    """Return the folder of the instruments that the package ships."""
    return shipped_folder("protocols") / "instruments"


def known_instruments(folder: Path | None = None) -> list[str]:
    """Return the names of the instruments in `folder` (the shipped ones by default), sorted."""
    return sorted(path.stem for path in (folder or instruments_folder()).glob("*.yaml"))


def load_instrument(name_or_file: str | Path) -> Protocol:
    """Return the protocol of a shipped instrument, or of a file (a name that ends in `.yaml`).

    Raises:
        InstrumentError: no instrument of that name.
        InputError: the file cannot be read or is wrong; every fault is listed with line and column.
    """
    path = Path(name_or_file)
    if path.suffix in {".yaml", ".yml"}:
        return read_protocol(path)
    files = {name: instruments_folder() / f"{name}.yaml" for name in known_instruments()}
    return read_protocol(
        looked_up(str(name_or_file), files, called="instrument", error=InstrumentError, how_to_add=HOW_TO_ADD)
    )


def at_rate(protocol: Protocol, rate_hz: float | None) -> Protocol:
    """Return the protocol of a device that is set to another sample rate than the usual one, where one is given."""
    if rate_hz is None:
        return protocol
    return protocol.model_copy(update={"timing": protocol.timing.model_copy(update={"rate_hz": rate_hz})})


def read_protocol(path: Path) -> Protocol:
    """Return the protocol in the file `path`.

    Raises:
        InputError: the file cannot be read or is wrong; every fault is listed with line and column.
    """
    faults: list[Problem] = []
    document = load_yaml(path, faults)
    protocol = validate(document, Protocol, faults) if document is not None else None
    if document is not None and protocol is not None and protocol.name != path.stem:
        remedy = f"rename the file to {protocol.name}.yaml or change the name in it"
        faults.append(document.problem(("name",), f"the name {protocol.name!r} is not the file's", remedy))
    if protocol is None or faults:
        raise InputError(faults)
    return protocol
