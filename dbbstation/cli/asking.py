"""Ask for missing options on a terminal; in a pipe, name all of them in one error."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import click

from dbbstation.cli.output import echo
from dbbstation.text.written import on_one_line

if TYPE_CHECKING:
    from collections.abc import Sequence


def on_terminal() -> bool:
    """Return whether questions can be answered."""
    return sys.stdin.isatty() and sys.stderr.isatty()


class Asker:
    """Asks one question after another; without a terminal it collects what is missing."""

    def __init__(self) -> None:
        self.terminal = on_terminal()
        self._missing: list[str] = []

    def text(self, question: str, option: str, choices: Sequence[str] = (), default: str | None = None) -> str:
        """Return an answer; without a terminal return an empty text, which `check` refuses.

        Args:
            option: equivalent on the command line.
        """
        if not self.terminal:
            self._missing.append(f"{option} ({question})")
            return ""
        kind = click.Choice(list(choices)) if choices else None
        return str(
            click.prompt(on_one_line(question), type=kind, default=default, show_default=bool(default), err=True)
        )

    def give(self, option: str, why: str) -> None:
        """Note a required option that no answer can replace; `check` then refuses, even on a terminal."""
        self._missing.append(f"{option} ({why})")

    def number(self, question: str, option: str, *, needed: bool = False) -> float | None:
        """Return a number; None if it is unknown or cannot be asked."""
        if not self.terminal:
            self.text(question, option)
            return None
        while True:
            answer = self.text(question if needed else f"{question}, Enter if it is unknown", option, default="")
            try:
                if answer or not needed:
                    return float(answer.replace(",", ".")) if answer else None
            except ValueError:
                echo(f"`{answer}` is not a number", err=True)

    def check(self) -> None:
        """Refuse missing answers.

        Raises:
            click.UsageError: names every option that is missing.
        """
        if self._missing:
            raise click.UsageError("state these facts, which the files lack:\n  " + "\n  ".join(self._missing))
