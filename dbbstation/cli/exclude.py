"""The option that leaves tests out."""

from __future__ import annotations

import click


def _names(_context: click.Context, _parameter: click.Parameter, given: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(name.strip() for text in given for name in text.split(",") if name.strip())


exclude_option = click.option(
    "--exclude",
    multiple=True,
    metavar="TEST,...",
    callback=_names,
    help="Leave tests out; may be given more than once.",
)
