"""Command groups that import only the called command, so that `--help` is fast."""

from __future__ import annotations

import difflib
import importlib
import keyword
from typing import TYPE_CHECKING, Any

import click
from click.types import StringParamType

from dbbstation.cli.log import attended

if TYPE_CHECKING:
    from collections.abc import Mapping

    from click import Context, Parameter


class Utf8(StringParamType):
    """A text in UTF-8; file names may hold any bytes."""

    def convert(self, value: Any, param: Parameter | None, ctx: Context | None) -> Any:  # noqa: ANN401 - as click has it
        """Return the text.

        Raises:
            BadParameter: bytes that are no characters.
        """
        text = super().convert(value, param, ctx)
        try:
            str(text).encode()
        except UnicodeEncodeError as error:
            self.fail(f"its character {error.start + 1} is not written in UTF-8; type it again", param, ctx)
        return text


def made_ready(command: click.Command) -> click.Command:
    """Let a command, or every one of a group, keep the log, refuse texts that are not UTF-8, and show its examples unwrapped."""
    for inner in command.commands.values() if isinstance(command, click.Group) else ():
        made_ready(inner)
    for parameter in command.params:
        if type(parameter.type) is StringParamType:
            parameter.type = Utf8()
    # Docstrings are raw, so that they may hold backslashes; click wants its "do not wrap" as the one character.
    command.help = (command.help or "").replace(r"\b", "\b")
    return attended(command)


class LazyGroup(click.Group):
    """Loads a command's module on demand."""

    def __init__(
        self,
        *,
        table: Mapping[str, str],
        package: str,
        modules: Mapping[str, str] | None = None,
        **more: Any,  # noqa: ANN401 - as click has it
    ) -> None:
        super().__init__(**more)
        self._modules = modules or {}
        self._table = table
        self._package = package

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """Return the names of all commands."""
        return sorted(self._table)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """Import the command's module."""
        if cmd_name not in self._table:
            return None
        name = cmd_name.replace("-", "_")
        name += "_" if keyword.iskeyword(name) else ""
        place, _, name = self._modules.get(cmd_name, f"{name}.{name}").partition(".")
        return made_ready(getattr(importlib.import_module(f"{self._package}.{place}"), name))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, or suggest similar ones."""
        name = args[0]
        near = difflib.get_close_matches(name, self._table, n=3)
        if name not in self._table and not name.startswith("-") and near:
            ctx.fail(f"No such command {name!r}; did you mean {' or '.join(near)}?")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """List commands from the table without imports."""
        with formatter.section("Commands"):
            formatter.write_dl(sorted(self._table.items()))
