"""Variants of a device in one protocol file: firmware, resolution, amplifier."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from dbbstation.files.yaml.schema import Partly, Schema, validate
from dbbstation.instrument.frame import Frame  # noqa: TC001 (pydantic needs it at run time)
from dbbstation.instrument.protocol import Ask, Length, LineSettings, Name, Protocol, Reference, Reply, Timing

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.errors import Problem
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


def variant(document: YamlDocument, name: str, faults: list[Problem]) -> Protocol | None:
    """Return one variant of a protocol file; None with faults added.

    Args:
        document: valid as a `ProtocolFile`.
        name: one not under `profiles` is the usual one.
    """
    chosen = _merged(document, name if name in document.data.get("profiles", {}) else "")
    protocol = validate(chosen, Protocol, faults)
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
