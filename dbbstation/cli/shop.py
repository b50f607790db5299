"""The shop's settings as defaults of options."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from dbbstation.cli.output import say
from dbbstation.computing.grouped import grouped

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from dbbstation.files.formats.settings import Setting, Settings

SETTINGS_OPTION = "settings"
"""Name of the program's option `--settings FILE`, which replaces both files that are looked for."""

_SESSIONS = ("sessions", "folder", "folders", "a")
"""Names of the arguments that are sessions."""

_MADE = frozenset({"measure", "simulate"})
"""Commands whose `--out` is a session."""

_OF_FOLDERS = frozenset({"fleet", "history"})
"""Commands whose folder holds sessions, and is none."""

_KEPT, _TAKEN, _LEFT = "dbbstation.settings", "dbbstation.settings.taken", "dbbstation.settings.left"
"""Keys of click's notes about one call: the settings, the options that took one, how many options are still to come."""

_ONE_THING = frozenset({"bar", "numbers"})
"""Blocks that are one thing: an option for a part of it on the command line sets all of the block aside."""


class ShopOption(click.Option):
    """An option with a default from the shop's settings."""

    def __init__(
        self,
        declarations: Any,  # noqa: ANN401 - as click has it
        *,
        setting: str,
        factor: float = 1.0,
        goes_with: str = "",
        **more: Any,  # noqa: ANN401 - as click has it
    ) -> None:
        super().__init__(declarations, **more)
        self.setting = setting
        self._goes_with = goes_with
        self._factor = factor

    def consume_value(self, ctx: click.Context, opts: Mapping[str, Any]) -> tuple[Any, ParameterSource]:
        """Return the value from command line, settings or program, and note its origin."""
        value, source = super().consume_value(ctx, opts)
        if ctx.resilient_parsing:
            return value, source
        options = [option for option in ctx.command.params if isinstance(option, ShopOption)]
        found = None if source is not ParameterSource.DEFAULT else self._found(ctx, opts, options)
        if found is not None:
            value, source = self._converted(found.value), ParameterSource.DEFAULT_MAP
            ctx.meta.setdefault(_TAKEN, []).append((found, f"{self.opts[0]} {value}"))
        ctx.meta[_LEFT] = ctx.meta.get(_LEFT, len(options)) - 1
        if not ctx.meta[_LEFT]:
            _say_taken(ctx.meta.get(_TAKEN, []))
        return value, source

    def _found(self, ctx: click.Context, opts: Mapping[str, Any], options: Iterable[ShopOption]) -> Setting | None:
        block = self.setting.partition(".")[0]
        given = {option.setting.partition(".")[0] for option in options if option.name in opts}
        if block in _ONE_THING & given or self._goes_with in opts:
            return None
        return _settings(ctx, opts).values.get(self.setting)

    def _converted(self, value: Any) -> Any:  # noqa: ANN401 - text or number
        # Twelve digits: 0.0005 mm are 0.5 µm, not 0.49999999999999994.
        return value if isinstance(value, str) or self._factor == 1.0 else float(f"{value * self._factor:.12g}")


def from_settings(name: str) -> bool:
    """Return whether a parameter comes from settings."""
    return click.get_current_context().get_parameter_source(name) is ParameterSource.DEFAULT_MAP


def shop_settings() -> Settings:
    """Return the settings of the command that runs.

    Raises:
        InputError: every fault of their files.
    """
    context = click.get_current_context()
    return _settings(context, context.params)


def folder_of_sessions(command: str | None, values: Mapping[str, Any]) -> Path | None:
    """Return the folder of a command's sessions, or None."""
    names = (*_SESSIONS, *(["out"] if command in _MADE else []))
    given = next((values[name] for name in names if values.get(name)), None)
    if isinstance(given, list | tuple):
        given = given[0]
    if not isinstance(given, str | Path):
        return None
    path = Path(given).absolute()
    if command in _OF_FOLDERS:
        return path
    return path.parent.parent if path.name == "session.yaml" else path.parent


def _settings(ctx: click.Context, values: Mapping[str, Any]) -> Settings:
    from dbbstation.files.formats.settings import read_settings, settings_files

    if _KEPT not in ctx.meta:
        named = ctx.find_root().params.get(SETTINGS_OPTION)
        beside = folder_of_sessions(ctx.info_name, values) or Path.cwd()
        ctx.meta[_KEPT] = read_settings(settings_files(beside) if named is None else [Path(named)])
    kept: Settings = ctx.meta[_KEPT]
    return kept


def _say_taken(taken: Iterable[tuple[Setting, str]]) -> None:
    for file, texts in grouped((setting.file, text) for setting, text in taken).items():
        say(f"settings: {', '.join(texts)} (from {file})")
