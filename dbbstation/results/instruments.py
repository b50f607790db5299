"""The result of `instruments`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from dbbstation.facts import of_facts
from dbbstation.facts.serialise import Absent

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dbbstation.instrument.protocol import Protocol


@dataclass(frozen=True)
class InstrumentResult:
    """An instrument."""

    name: str
    profile: str
    title: str
    line: Mapping[str, object]
    mode: str
    readings_per_second: float
    not_verified: tuple[str, ...]
    has_checksum: bool
    counts_samples: bool
    range_mm: tuple[float, ...]
    profiles: tuple[str, ...]
    protocol: Annotated[Mapping[str, object] | None, Absent] = None


@dataclass(frozen=True)
class InstrumentsResult:
    """All known instruments."""

    instruments: tuple[InstrumentResult, ...]


def instrument_result(protocol: Protocol, profiles: Iterable[str], *, whole: bool = False) -> InstrumentResult:
    """Return the description of an instrument."""
    return of_facts(
        InstrumentResult,
        protocol,
        line=protocol.line.model_dump(),
        mode=protocol.ask.mode,
        readings_per_second=protocol.fastest_hz(),
        not_verified=tuple(one.says for one in protocol.references if not one.verified),
        counts_samples=protocol.counter_modulus is not None,
        range_mm=tuple(protocol.length.range_mm),
        profiles=tuple(profiles),
        protocol=protocol.model_dump(mode="json") if whole else None,
    )
