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
        value: in the key's unit; None if not set.
        origin: file and line, or `dbbstation`; None if not set.
    """

    value: str | int | float | None
    origin: Annotated[str | None, Field(serialization_alias="from")]


@dataclass(frozen=True)
class ShopTolerance:
    """A tolerance of the shop.

    Attributes:
        filter: of the figure in words, or None.
        tests: empty for all.
        directions: empty for both.
    """

    quantity: str
    largest_um: float
    filter: str | None
    tests: tuple[str, ...]
    directions: tuple[str, ...]


@dataclass(frozen=True)
class SettingsResult:
    """The shop's settings.

    Attributes:
        files: the first with a key decides.
        tolerances_from: their file, or None.
    """

    files: tuple[str, ...]
    values: Mapping[str, ShownSetting]
    tolerances: tuple[ShopTolerance, ...]
    tolerances_from: str | None
