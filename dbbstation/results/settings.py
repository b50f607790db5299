"""The result of `settings`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field


@dataclass(frozen=True)
class ShownSetting:
    """One setting.

    Attributes:
        origin: file and line, or `dbbstation`; None if not set.
    """

    value: str | int | float | None
    origin: Annotated[str | None, Field(serialization_alias="from")]


@dataclass(frozen=True)
class ShopTolerance:
    """A tolerance of the shop."""

    quantity: str
    largest_um: float
    filter: str | None
    tests: tuple[str, ...]
    directions: tuple[str, ...]


@dataclass(frozen=True)
class SettingsResult:
    """The shop's settings; the first file with a key decides."""

    files: tuple[str, ...]
    values: Mapping[str, ShownSetting]
    tolerances: tuple[ShopTolerance, ...]
    tolerances_from: str | None
