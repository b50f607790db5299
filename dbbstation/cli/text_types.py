"""The option type for texts, which refuses invalid bytes by the option's name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click
from click.types import StringParamType

if TYPE_CHECKING:
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


def in_utf8(command: click.Command) -> click.Command:
    """Let a command, or every command of a group, refuse texts that are no UTF-8."""
    for inner in command.commands.values() if isinstance(command, click.Group) else ():
        in_utf8(inner)
    for parameter in command.params:
        if type(parameter.type) is StringParamType:
            parameter.type = Utf8()
    return command
