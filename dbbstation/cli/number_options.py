"""The shop's number format, for tables from elsewhere."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.output import say
from dbbstation.cli.shop import shop_settings

if TYPE_CHECKING:
    from dbbstation.files.formats.number_language import NumberLanguage


def shops_numbers() -> NumberLanguage | None:
    """Return the number format of the shop's settings, with a note; None if not set.

    For commands in which a file decides first.
    """
    from dbbstation.files.formats.number_language import number_language

    values = shop_settings().values
    found = {key: values[name] for key in ("decimal", "separator") if (name := f"numbers.{key}") in values}
    if not found:
        return None
    texts = ", ".join(f"--{key} {setting.value}" for key, setting in found.items())
    say(f"settings: {texts} (from {next(iter(found.values())).file})")
    return number_language(*(str(found[key].value) if key in found else None for key in ("decimal", "separator")))
