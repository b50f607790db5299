"""The shop's settings with where each comes from: the result of `settings`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field


@dataclass(frozen=True)
class ShownSetting:
    """One setting.

    Attributes:
        value: in the unit that its key says; None where nobody has set it.
        origin: file and line, or `dbbstation` for a value of the program's own; None where nobody has set it.
    """

    value: str | int | float | None
    origin: Annotated[str | None, Field(serialization_alias="from")]


@dataclass(frozen=True)
class ShopTolerance:
    """A tolerance of the shop.

    Attributes:
        filter: of the figure in words; None where none acts on it.
        tests: that it holds for; empty for all.
        directions: that it holds for; empty for both.
    """

    quantity: str
    largest_um: float
    filter: str | None
    tests: tuple[str, ...]
    directions: tuple[str, ...]


@dataclass(frozen=True)
class SettingsResult:
    """What the shop has set.

    Attributes:
        files: that were read, the first that has a key decides.
        tolerances_from: file that they come from; None where there are none.
    """

    files: tuple[str, ...]
    values: Mapping[str, ShownSetting]
    tolerances: tuple[ShopTolerance, ...]
    tolerances_from: str | None
