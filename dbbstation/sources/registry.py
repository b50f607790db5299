"""Find error sources by name, in this package and installed packages."""

from __future__ import annotations

from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING

from dbbstation.catalogue import FoundClass, InFolders, added, installed, looked_up
from dbbstation.errors import InputError, ModelError, Problem, refuse
from dbbstation.sources import causes, unmodelled
from dbbstation.sources.contract import ErrorSource
from dbbstation.sources.trial import trial_machine, tried, undeclared

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

GROUP = "dbbstation.sources"
"""Group of entry points that name subclasses of `ErrorSource`."""

HOW_TO_ADD = "one of your own is given with --source-files FILE.py, or its package installed"
"""Hint for unknown names."""


def known_sources() -> Mapping[str, ErrorSource]:
    """Return all error sources, sorted by name.

    Raises:
        InputError: an installed source cannot be loaded, breaks the contract, or has a taken name.
    """
    return _known()[0]


@cache
def _known() -> tuple[Mapping[str, ErrorSource], Mapping[str, str]]:
    faults: list[Problem] = []
    others = installed(GROUP, _BASE, faults)
    found, whose = _with(InFolders(_BASE, causes, unmodelled), {}, others, faults)
    refuse(faults)
    return found, whose


_BASE: type[ErrorSource] = ErrorSource  # type: ignore[type-abstract] # subclasses are instantiated


def known_with(others: Sequence[FoundClass[ErrorSource]], faults: list[Problem]) -> Mapping[str, ErrorSource]:
    """Return all known sources plus sources of further classes, whose faults are appended to `faults`.

    Raises:
        InputError: as `known_sources`.
    """
    known, whose = _known()
    return _with(known, whose, others, faults)[0]


def _with(
    known: Mapping[str, ErrorSource],
    whose: Mapping[str, str],
    others: Sequence[FoundClass[ErrorSource]],
    faults: list[Problem],
) -> tuple[Mapping[str, ErrorSource], Mapping[str, str]]:
    if not others:
        return known, whose
    found, places = dict(known), dict(whose)
    for other in others:
        try:
            one = other.made(
                undeclared(other.kind), lambda one: tried(one, trial_machine()), ", when it was tried on a circle"
            )
        except InputError as error:
            faults += error.problems
        else:
            added(found, places, one, other.place, called="an error source", faults=faults)
    return MappingProxyType(dict(sorted(found.items()))), places


def sources_named(names: Iterable[str], known: Mapping[str, ErrorSource] | None = None) -> tuple[ErrorSource, ...]:
    """Return sources by name.

    Args:
        known: None for the sources of this package and installed packages.

    Raises:
        ModelError: an unknown name.
    """
    among = known_sources() if known is None else known
    return tuple(
        looked_up(name, among, called="error source", error=ModelError, how_to_add=HOW_TO_ADD) for name in names
    )
