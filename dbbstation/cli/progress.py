"""Progress of long work: a bar on a terminal; in a pipe nothing, or a line for each stage."""

from __future__ import annotations

import shutil
import sys
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

import click

from dbbstation.cli.output import log_said, say

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

_WIDTH = 24
"""Characters of a bar that has a text beside it."""


@contextmanager
def progress_bar(label: str, total: int) -> Iterator[Callable[[int], None]]:
    """Show a bar on standard error; yields what is to be told how much of `total` is done."""
    hidden = not sys.stderr.isatty()
    with click.progressbar(length=total, label=label, file=sys.stderr, show_pos=True, hidden=hidden) as bar:
        yield lambda done: bar.update(done - bar.pos)


@contextmanager
def stage_bar(label: str, stages: Mapping[str, int], *, plain: bool = False) -> Iterator[Callable[[str], None]]:
    """Show how far work has come that tells its stages; yields what is to be told each stage as it begins.

    On a terminal a bar begins with the first stage, so that lines said before stay whole. Elsewhere, and where `plain`,
    each stage is a line.

    Args:
        label: what is being done.
        stages: how much is done when a stage begins [%], in their order; a text belongs to the stage whose name it begins
            with.
        plain: lines on a terminal too.
    """
    if plain or not sys.stderr.isatty():
        yield lambda text: say(f"... {text}")
        return
    # Room for the ^C of a terminal is left, lest it begins a line of its own.
    room = max(shutil.get_terminal_size().columns - len(f"{label}  [{'':{_WIDTH}}]  100%  ^C") - 1, 0)

    def beside(text: str | None) -> str:
        whole = text or ""
        return whole if len(whole) <= room else whole[: max(room - 1, 0)] + "…"

    with ExitStack() as stack:
        bar = click.progressbar(
            length=100, label=label, file=sys.stderr, width=_WIDTH, show_eta=False, item_show_func=beside
        )
        reached = 0.0

        def tell(text: str) -> None:
            nonlocal reached
            log_said(f"... {text}")
            if not reached:
                stack.enter_context(bar)
            reached = max(reached, 1.0, _reached(text, stages, reached))
            bar.update(int(reached) - bar.pos, text)
            bar.render_progress()

        yield tell
        if reached:
            bar.update(100 - bar.pos, "done")


def _reached(text: str, stages: Mapping[str, int], before: float) -> float:
    """How much is done when a stage begins; one that comes again goes a quarter of the way to the next [%]."""
    names = list(stages)
    here = next((k for k, name in enumerate(names) if text.startswith(name)), None)
    if here is None:
        return before
    following = 100 if here + 1 == len(names) else stages[names[here + 1]]
    begins = stages[names[here]]
    return begins if before < begins else before + max(following - before, 0.0) / 4.0
